//! The paper's figures as printed there, under the labels of their tables.

pub mod metadrive;
pub mod safebench;

/// Our ego policies that stand for one of the paper's, with its name there.
pub const POLICIES: [(&str, &str); 2] = [("idm", "IDM"), ("learned", "RL")];

/// The paper's name of an ego policy; `None` for one that it does not have.
pub fn policy_name(ego: &str) -> Option<&'static str> {
    POLICIES.iter().find(|(ours, _)| *ours == ego).map(|(_, name)| *name)
}

/// The ego as the paper calls it, or as we do.
pub fn policy(ego: &str) -> String {
    policy_name(ego).map_or(ego.to_string(), str::to_string)
}
