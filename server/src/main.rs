//! `lodestream-server`: the commands that a deployment needs, without any GPU code.

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use lodestream_server::commands::{
    build, finish, inspect, ping, preview, serve, sign, token, verify,
};

/// Turn scans into level-of-detail datasets and host them over HTTP
#[derive(Debug, Parser)]
#[command(name = "lodestream-server", version, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Serve(Box<serve::ServeArgs>),
    Ping(ping::PingArgs),
    Token(token::TokenArgs),
    Sign(sign::SignArgs),
    Build(build::BuildArgs),
    Inspect(inspect::InspectArgs),
    Verify(verify::VerifyArgs),
    Preview(preview::PreviewArgs),
}

fn main() -> ExitCode {
    finish(match Cli::parse().command {
        Command::Serve(args) => serve::run(*args),
        Command::Ping(args) => ping::run(&args),
        Command::Token(args) => token::run(&args),
        Command::Sign(args) => sign::run(&args),
        Command::Build(args) => build::run(args),
        Command::Inspect(args) => inspect::run(args),
        Command::Verify(args) => verify::run(args),
        Command::Preview(args) => preview::run(&args),
    })
}
