//! The `evodrive` binary: hands the arguments to the library and turns its verdict into an exit code.

fn main() -> std::process::ExitCode {
    evodrive::cli::main()
}
