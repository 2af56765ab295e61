//! Experiment files: read, composed from their bases, checked, and resolved to the scenes and the study that they describe.

mod agreement_study;
mod calibration;
mod check;
mod downstream_file;
mod ego_weights;
mod error;
mod family_name;
mod file;
mod key;
mod keys;
mod model_options;
mod models;
mod named_driver;
mod options;
mod own_driver;
mod page;
mod parent_program;
mod place;
mod program_file;
mod read;
mod relations;
mod scenes;
mod schema;
mod set;
mod starter;
mod study;
mod toml_file;
mod training_file;

pub use agreement_study::agreement_study;
pub use downstream_file::{Arm, DownstreamFile, Schedule, SetSizes};
pub use ego_weights::EgoWeights;
pub use error::{ExperimentError, OptionError, did_you_mean};
pub use family_name::family_named;
pub use file::{Composed, composed};
pub use model_options::ModelOptions;
pub use models::{asked, by_role, is_scripted};
pub use named_driver::{PlannerFile, named_driver};
pub use options::{BudgetOptions, Experiment, LineageOptions, PlainContacts, SceneSource, SplitOptions};
pub use page::{listing, page};
pub use parent_program::ParentProgram;
pub use place::{PROTOCOLS, shipped_weights};
pub use program_file::{
    BackendMark, CarriedCounsel, Conditions, ContractMark, FORMAT as PROGRAM_FORMAT, Finding, ProgramFile,
    ProgramFileError, safebench as safebench_files, value_span,
};
pub use scenes::{read_pool, read_scenes, read_scenes_as};
pub use schema::schema;
pub use set::read as typed_value;
pub use starter::{Started, Starter, starter};
pub use training_file::TrainingFile;
