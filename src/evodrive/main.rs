//! The `evodrive` binary: hands the arguments to the library and turns its verdict into an exit code.

#![forbid(unsafe_code)]

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> std::process::ExitCode {
    evodrive::cli::main()
}
