//! Arguments, experiment files, one file a command.
