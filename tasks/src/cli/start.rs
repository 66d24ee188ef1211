//! From the words of a command line to an exit code.

use super::{Cli, run};
use crate::error::TaskError;
use clap::Parser;
use std::ffi::OsString;
use std::io::IsTerminal;
use tracing_subscriber::EnvFilter;

/// Runs the whole command line, `words[0]` being the program's name, and gives the process exit code. Starts the log on
/// stderr, and may catch Ctrl-C and set the number of worker threads: once per process, so it is called once.
pub fn start(words: impl IntoIterator<Item = OsString>) -> u8 {
    let cli = match Cli::try_parse_from(words) {
        Ok(cli) => cli,
        Err(usage) => {
            // Help goes to stdout and ends with code 0, a usage error to stderr and with code 2; a closed pipe is no error.
            let _ = usage.print();
            return u8::try_from(usage.exit_code()).unwrap_or(2);
        }
    };
    start_log(cli.verbose);
    match run(cli) {
        Ok(code) => code,
        Err(error) => {
            tracing::error!("{error:#}");
            error.downcast_ref::<TaskError>().map_or(2, TaskError::exit_code)
        }
    }
}

fn start_log(verbose: u8) {
    let level = match verbose {
        0 => "warn",
        1 => "info",
        _ => "debug",
    };
    let filter = EnvFilter::try_from_env("DSM_LOG").unwrap_or_else(|_| EnvFilter::new(level));
    let color = std::env::var_os("NO_COLOR").is_none() && std::io::stderr().is_terminal();
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(color)
        .without_time()
        .with_target(false)
        .init();
}
