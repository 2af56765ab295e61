//! The drivers that stand in columns of their own, and what tables call them.

/// The drivers that can be columns: name, weights that the program carries or policy, head.
pub const DRIVERS: [(&str, &str, &str); 7] = [
    ("idm", "idm", "IDM"),
    ("idm-lights", "idm-lights", "IDM, lights"),
    ("pdm", "pdm", "PDM"),
    ("frenet", "frenet", "Frenet"),
    ("replay", "replay", "Replay"),
    ("sac-metadrive", "evodrive:sac-metadrive", "SAC"),
    ("sac-metadrive-2", "evodrive:sac-metadrive-2", "SAC 2"),
];
