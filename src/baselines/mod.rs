//! Source families: contract, parent program, signature mechanism; and the kernel they share.
