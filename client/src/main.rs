//! `lodestream`: the whole toolbox.

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use lodestream_client::{
    commands::{demo, doctor, eval, export, load, shot, stability, view},
    source::{BlockingSource, Source, use_token},
};
use lodestream_server::commands::{build, finish, inspect, preview, serve, sign, token, verify};

/// Stream point clouds of any size: build, host, look, measure
#[derive(Debug, Parser)]
#[command(name = "lodestream", version, arg_required_else_help = true)]
struct Cli {
    /// Bearer token, shown to every server that is read from; best given in the environment, where
    /// other users of this machine do not see it
    #[arg(long, global = true, env = "LODESTREAM_TOKEN", hide_env_values = true)]
    token: Option<String>,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Build(build::BuildArgs),
    Inspect(inspect::InspectArgs),
    Verify(verify::VerifyArgs),
    Preview(preview::PreviewArgs),
    Serve(Box<serve::ServeArgs>),
    Token(token::TokenArgs),
    Sign(sign::SignArgs),
    Export(export::ExportArgs),
    Shot(shot::ShotArgs),
    Demo(demo::DemoArgs),
    Eval(eval::EvalArgs),
    Load(load::LoadArgs),
    Doctor(doctor::DoctorArgs),
    Stability(stability::StabilityArgs),
    View(view::ViewArgs),
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    if let Some(Err(e)) = cli.token.as_deref().map(use_token) {
        return finish(Err(anyhow::anyhow!("--token: {e}")));
    }
    finish(match cli.command {
        Command::Build(args) => build::run(args),
        Command::Inspect(args) => inspect_any(&args),
        Command::Verify(args) => verify::run(args),
        Command::Preview(args) => preview::run(&args),
        Command::Serve(args) => serve::run(*args),
        Command::Token(args) => token::run(&args),
        Command::Sign(args) => sign::run(&args),
        Command::Export(args) => export::run(args),
        Command::Shot(args) => shot::run(args),
        Command::Demo(args) => demo::run(args),
        Command::Eval(args) => eval::run(args),
        Command::Load(args) => load::run(args),
        Command::Doctor(args) => doctor::run(args),
        Command::Stability(args) => stability::run(args),
        Command::View(args) => view::run(args),
    })
}

/// Unlike the server's, this one reads URLs too.
fn inspect_any(args: &inspect::InspectArgs) -> anyhow::Result<ExitCode> {
    inspect::inspect(args, BlockingSource::new(Source::parse(&args.source)?)?)
}
