//! `lodestream`: the whole toolbox.

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use lodestream_client::{
    commands::{demo, doctor, eval, export, load, shot, stability},
    source::{BlockingSource, Source},
};
use lodestream_server::commands::{build, finish, inspect, serve, verify};

/// Stream point clouds of any size: build, host, look, measure
#[derive(Debug, Parser)]
#[command(name = "lodestream", version, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Build(build::BuildArgs),
    Inspect(inspect::InspectArgs),
    Verify(verify::VerifyArgs),
    Serve(serve::ServeArgs),
    Export(export::ExportArgs),
    Shot(shot::ShotArgs),
    Demo(demo::DemoArgs),
    Eval(eval::EvalArgs),
    Load(load::LoadArgs),
    Doctor(doctor::DoctorArgs),
    Stability(stability::StabilityArgs),
}

fn main() -> ExitCode {
    finish(match Cli::parse().command {
        Command::Build(args) => build::run(args),
        Command::Inspect(args) => inspect_any(&args),
        Command::Verify(args) => verify::run(args),
        Command::Serve(args) => serve::run(args),
        Command::Export(args) => export::run(args),
        Command::Shot(args) => shot::run(args),
        Command::Demo(args) => demo::run(args),
        Command::Eval(args) => eval::run(args),
        Command::Load(args) => load::run(args),
        Command::Doctor(args) => doctor::run(args),
        Command::Stability(args) => stability::run(args),
    })
}

/// Unlike the server's, this one reads URLs too.
fn inspect_any(args: &inspect::InspectArgs) -> anyhow::Result<ExitCode> {
    inspect::inspect(args, BlockingSource::new(Source::parse(&args.source)?)?)
}
