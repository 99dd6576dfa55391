//! One file a verb.

mod args;
mod bench;
mod check;
mod compare;
mod devices;
mod doctor;
mod gallery;
mod golden;
mod library;
mod output;
mod plan;
mod run;
mod targets;
mod watch;

use std::io::{IsTerminal, Write};
use std::process::ExitCode;

use clap::Parser;
use pipe::Failure;

use args::{Cli, Verb};

/// Parses, runs, and says what went wrong.
pub(crate) fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(e) => {
            // Help and version are no mistakes; everything else on the command line is one: exit code 1.
            let _ = e.print();
            return ExitCode::from(u8::from(e.use_stderr()));
        }
    };
    pipe_gpu::hush_layers();
    output::set_verbosity(cli.quiet, cli.verbose);
    let result = match cli.verb {
        Verb::Run(a) => run::run(&a),
        Verb::Check(a) => check::check(&a),
        Verb::Plan(a) => plan::plan(&a),
        Verb::Info(a) => check::info(&a),
        Verb::Nodes(a) => library::nodes(&a),
        Verb::Presets(a) => library::presets(&a),
        Verb::Devices(a) => devices::devices(&a),
        Verb::Compare(a) => compare::compare(&a),
        Verb::Test(a) => golden::test(&a),
        Verb::Bench(a) => bench::bench(&a),
        Verb::Watch(a) => watch::watch(&a),
        Verb::Doctor(a) => doctor::doctor(&a),
        Verb::Completions { shell } => args::completions(shell),
        Verb::Man => args::man(),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            let text = failure.to_string();
            if !text.is_empty() {
                let _ = writeln!(std::io::stderr(), "{text}");
            }
            ExitCode::from(failure.exit_code())
        }
    }
}

/// Whether messages may be coloured.
fn colour() -> bool {
    std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none()
}

/// The folder for compiled pipelines: `$XDG_CACHE_HOME/pipe`, or the system's own place.
fn cache_folder() -> Option<std::path::PathBuf> {
    let var = |name| std::env::var_os(name).filter(|v| !v.is_empty()).map(std::path::PathBuf::from);
    let base = if cfg!(windows) {
        var("LOCALAPPDATA")
    } else if cfg!(target_os = "macos") {
        var("HOME").map(|h| h.join("Library/Caches"))
    } else {
        var("XDG_CACHE_HOME").or_else(|| var("HOME").map(|h| h.join(".cache")))
    };
    base.map(|b| b.join("pipe"))
}

/// The device that `--device` or `PIPE_DEVICE` names.
fn device_choice(asked: Option<&str>) -> pipe_gpu::Choice {
    let asked = asked.map(str::to_owned).or_else(|| std::env::var("PIPE_DEVICE").ok());
    pipe_gpu::Choice::parse(&asked.unwrap_or_default())
}

/// Writes to stdout; a reader that went away is no mistake.
fn print(text: &str) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => Err(Failure::World(format!("cannot write to stdout: {e}"))),
        _ => Ok(()),
    }
}

/// JSON on stdout, indented.
fn print_json(value: &serde_json::Value) -> Result<(), Failure> {
    let text = serde_json::to_string_pretty(value).map_err(|e| Failure::World(e.to_string()))?;
    print(&format!("{text}\n"))
}
