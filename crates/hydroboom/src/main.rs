//! `hydroboom`: command line. One module per command, which reads options and prints, draws and writes results.

mod ablate;
mod bench;
mod benchmark_gains;
mod bounds;
mod calibrate;
mod check;
mod commission;
mod commissioning_basis;
mod controller_model;
mod crane_file;
mod design;
mod difference_text;
mod doctor;
mod eigen;
mod energy;
mod estimate;
mod estimator;
mod export;
mod faults;
mod healthy;
mod interruptible;
mod learn;
mod linearise;
mod log;
mod log_mapping;
mod machine;
mod machine_argument;
mod machine_choice;
mod motion;
mod new;
mod number;
mod origin;
mod output;
mod paths;
mod processor;
mod renamed_option;
mod run;
mod scenarios;
mod sensitivity;
mod show;
mod signals_text;
mod simulate;
mod strategy_argument;
mod study;
mod supervision;
mod tip;
mod trials;
mod tune;
mod validate;
mod verdict_text;
mod virtual_crane;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use miette::{MietteHandlerOpts, Result};
use std::io::IsTerminal;
use std::process::ExitCode;

/// Simulation and real-time control of electro-hydraulic cranes with a flexible boom.
#[derive(Parser)]
#[command(version, after_help = "Start with: hydroboom study")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    New(new::New),
    Check(check::Check),
    Commission(commission::Commission),
    Show(show::Show),
    Simulate(simulate::Simulate),
    Eigen(eigen::Eigen),
    Linearise(linearise::Linearise),
    Energy(energy::Energy),
    Design(design::Design),
    Motion(motion::MotionTests),
    Study(study::Study),
    Trials(trials::Trials),
    Ablate(ablate::Ablate),
    Bounds(bounds::Bounds),
    Estimate(estimate::Estimate),
    Estimator(estimator::Estimator),
    Tip(tip::Tip),
    Learn(learn::Learn),
    Validate(validate::Validate),
    Tune(tune::Tune),
    Sensitivity(sensitivity::Sensitivity),
    Virtual(virtual_crane::Virtual),
    Calibrate(calibrate::Calibrate),
    Export(export::Export),
    Scenarios(scenarios::Scenarios),
    Run(run::Run),
    Log(log::Log),
    Faults(faults::Faults),
    Supervision(supervision::Supervision),
    Doctor(doctor::Doctor),
    #[command(hide = true)]
    Machine(machine::Machine),
    Bench(bench::Bench),
}

fn main() -> ExitCode {
    processor::check();
    hydroboom_realtime::posix::survive_large_files();
    // wrapped for a terminal only: paths stay whole, and a log or a pipe gets one line per message
    let wrapped = std::io::stderr().is_terminal();
    let is_set = miette::set_hook(Box::new(move |_| {
        let options = MietteHandlerOpts::new().wrap_lines(wrapped).break_words(false);
        Box::new(options.build())
    }));
    // the hook is set here only; without it errors have a simpler format
    drop(is_set);
    let matches = with_negative_numbers(Arguments::command()).try_get_matches().unwrap_or_else(
        |mut error| {
            suggest_crane_option(&mut error);
            output::usage(&error);
            std::process::exit(error.exit_code())
        },
    );
    let arguments = Arguments::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    let result = paths::check(&matches).and_then(|()| run(arguments.command));
    match output::conclude(result) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            output::error(&error);
            ExitCode::FAILURE
        }
    }
}

/// Lets every option with a value take a negative number. An invalid one is then reported for its option
/// instead of as an unknown option `-5`.
fn with_negative_numbers(mut command: clap::Command) -> clap::Command {
    let names: Vec<String> =
        command.get_subcommands().map(|each| each.get_name().to_string()).collect();
    for name in names {
        command = command.mut_subcommand(name, with_negative_numbers);
    }
    command.mut_args(|argument| match argument.get_action().takes_values() {
        true => argument.allow_negative_numbers(true),
        false => argument,
    })
}

/// Names the option of a crane file where such a file stands by itself.
fn suggest_crane_option(error: &mut clap::Error) {
    if error.kind() != ErrorKind::UnknownArgument {
        return;
    }
    let tip = match error.get(ContextKind::InvalidArg) {
        Some(ContextValue::String(argument)) if argument.ends_with(".toml") => {
            format!("a crane file is named by '--crane {argument}'")
        }
        _ => return,
    };
    error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip.into()]));
}

/// Runs a command.
fn run(command: Command) -> Result<()> {
    match command {
        Command::New(command) => command.run(),
        Command::Check(command) => command.run(),
        Command::Commission(command) => command.run(),
        Command::Show(command) => command.run(),
        Command::Simulate(command) => command.run(),
        Command::Eigen(command) => command.run(),
        Command::Linearise(command) => command.run(),
        Command::Energy(command) => command.run(),
        Command::Design(command) => command.run(),
        Command::Motion(command) => command.run(),
        Command::Study(command) => command.run(),
        Command::Trials(command) => command.run(),
        Command::Ablate(command) => command.run(),
        Command::Bounds(command) => command.run(),
        Command::Estimate(command) => command.run(),
        Command::Estimator(command) => command.run(),
        Command::Tip(command) => command.run(),
        Command::Learn(command) => command.run(),
        Command::Validate(command) => command.run(),
        Command::Tune(command) => command.run(),
        Command::Sensitivity(command) => command.run(),
        Command::Virtual(command) => command.run(),
        Command::Calibrate(command) => command.run(),
        Command::Export(command) => command.run(),
        Command::Scenarios(command) => command.run(),
        Command::Run(command) => command.run(),
        Command::Log(command) => command.run(),
        Command::Faults(command) => command.run(),
        Command::Supervision(command) => command.run(),
        Command::Doctor(command) => command.run(),
        Command::Machine(command) => command.run(),
        Command::Bench(command) => command.run(),
    }
}
