//! The command line of `pipe`: arguments → decisions → run. The only place that knows terminal, environment and exit
//! codes.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::main()
}
