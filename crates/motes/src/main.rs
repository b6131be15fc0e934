//! The command line of Motes: a user of its library like any other.

mod cli;

fn main() -> std::process::ExitCode {
    cli::main()
}
