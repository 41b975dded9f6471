//! `lodestream-server`: the commands that a deployment needs, without any GPU code.

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use lodestream_server::commands::{build, finish, inspect, serve, verify};

/// Turn scans into level-of-detail datasets and host them over HTTP
#[derive(Debug, Parser)]
#[command(name = "lodestream-server", version, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Serve(serve::ServeArgs),
    Build(build::BuildArgs),
    Inspect(inspect::InspectArgs),
    Verify(verify::VerifyArgs),
}

fn main() -> ExitCode {
    finish(match Cli::parse().command {
        Command::Serve(args) => serve::run(args),
        Command::Build(args) => build::run(args),
        Command::Inspect(args) => inspect::run(args),
        Command::Verify(args) => verify::run(args),
    })
}
