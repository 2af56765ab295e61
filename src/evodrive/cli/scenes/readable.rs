//! The scene formats that are read, for `formats` and for the help of `scenes import`.

/// Formats that are read, as `scenes import` tells them apart: name, files, description.
pub const READ: [(&str, &str, &str); 6] = [
    ("scenarionet", "*.pkl, *.json", "ScenarioNet and MetaDrive scene descriptions; nothing in a pickle is executed"),
    ("commonroad", "*.xml", "CommonRoad 2018b and 2020a"),
    ("waymo", "*.tfrecord*", "Waymo Open Motion scenarios"),
    ("gpudrive", "*.json", "GPUDrive and Nocturne"),
    ("safebench", "*.xml, *.json with *.xodr", "SafeBench routes and scenario files on OpenDRIVE towns (--towns)"),
    ("pool", "*.pool", "scenes that `scenes import` or `scenes generate` wrote"),
];

/// Returns the list of what can be imported, for the help of `scenes import`.
pub fn in_help() -> String {
    let mut text = String::from("Formats, recognised by the files' content:");
    READ.iter().for_each(|(name, files, what)| text += &format!("\n  {name:<12} {files:<26} {what}"));
    text
}
