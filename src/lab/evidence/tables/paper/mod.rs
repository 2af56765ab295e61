//! The paper's figures as printed there, under the labels of their tables.

pub mod metadrive;
pub mod safebench;

use super::drivers::DRIVERS;

/// The figures of a printed row, each with the key of the column that shows it.
#[derive(Clone, Debug, PartialEq)]
pub struct Figures(Vec<(&'static str, f64)>);

impl Figures {
    /// Figures in the order of these columns.
    pub fn new<const N: usize>(columns: [&'static str; N], figures: &[f64; N]) -> Figures {
        Figures(columns.into_iter().zip(figures.iter().copied()).collect())
    }

    /// The figure of the column with this key; `None` where the paper prints no such column.
    pub fn under(&self, key: &str) -> Option<f64> {
        self.0.iter().find(|(column, _)| *column == key).map(|(_, figure)| *figure)
    }
}

/// Our ego policies that stand for one of the paper's, with its name there.
pub const POLICIES: [(&str, &str); 2] = [("idm", "IDM"), ("learned", "RL")];

/// The paper's name of an ego policy; `None` for one that it does not have.
pub fn policy_name(ego: &str) -> Option<&'static str> {
    POLICIES.iter().find(|(ours, _)| *ours == ego).map(|(_, name)| *name)
}

/// The ego as the paper calls it, or as we do.
pub fn policy(ego: &str) -> String {
    let ours = || DRIVERS.iter().find(|(name, ..)| *name == ego).map(|(.., head)| *head);
    policy_name(ego).or_else(ours).unwrap_or(ego).to_string()
}
