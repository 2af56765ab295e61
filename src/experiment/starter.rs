//! The first experiment file of a user: short, commented, on one of the shipped protocols.

use std::fmt::Write as _;
use std::path::PathBuf;

use super::{ExperimentError, OptionError, PlannerFile};
use crate::families;
use crate::objects::FamilyName;
use crate::scene::{Pool, usable};

/// What a file is written for.
#[derive(Clone, Debug)]
pub struct Starter {
    /// Names the experiment and its cassette.
    pub name: String,
    pub family: String,
    /// The scenes as the file names them, with what they hold; generated ones without.
    pub scenes: Option<(PathBuf, Pool)>,
    /// The planner that is the ego; IDM without.
    pub driver: Option<PlannerFile>,
}

/// Scenes of a small generated study.
const GENERATED: usize = 24;

/// The text of the file.
///
/// # Errors
/// An unknown family, a name that no run folder can have, too few usable scenes.
pub fn starter(starter: &Starter) -> Result<String, ExperimentError> {
    let option = |error| ExperimentError::Option { file: "init".into(), error };
    let sources = families::sources();
    let known: Vec<String> = sources.iter().map(|family| family.contract.family.to_string()).collect();
    let family = FamilyName::new(starter.family.as_str());
    let found = sources.get(&family).ok_or_else(|| option(OptionError::word("--family", family.as_str(), &known)))?;
    let name = toml::Value::String(starter.name.clone());
    super::key::Range::Name.check("NAME", &name).map_err(option)?;
    let staged = found.contract.backend == "safebench";
    if staged && starter.driver.is_some() {
        let expected =
            "a family for recorded traffic (`evodrive families`); SafeBench's protocol does not take planners";
        return Err(option(OptionError::new("--driver", format!("given beside --family {family}"), expected)));
    }
    let ego = if starter.driver.is_some() { "command" } else { "idm" };
    let against = if starter.driver.is_some() { "a planner of one's own" } else { "the IDM ego" };
    let protocol = if staged { "safebench" } else { "metadrive" };
    let mut text = format!(
        "# An experiment of your own. Keys that are not here come from its base; docs/EXPERIMENT.md lists every key.\n\
         base = \"evodrive:{protocol}\"\nname = \"{name}\"\n\
         describes = \"{family} evolved against {against}\"\n\
         cassette = \"{name}.jsonl\"   # recorded answers: `evodrive record {name}.toml` writes them\n",
        name = starter.name
    );
    if found.asks.counsel.is_some() {
        text.push_str(
            "counsel = { rounds = 3, vehicles = 8 }   # sets of attackers tried in a scene, vehicles shown\n",
        );
        text.push_str("roles.attacker_agent = \"scripted\"\n");
    }
    if found.asks.templates.is_some() {
        text.push_str("# [composition] can describe scenarios in words; without it the published templates stay.\n");
    }
    text.push_str(&scenes(starter, staged)?);
    let _ = write!(
        text,
        "\n[budget]\nepochs = 4\nslots = 6   # parallel proposals of an epoch\n\n\
         [[lineage]]\nid = \"{0}-{1}\"\nfamily = \"{0}\"\nego = \"{ego}\"\n",
        starter.family,
        if starter.driver.is_some() { "mine" } else { "idm" }
    );
    text.push_str(MODEL);
    if let Some(driver) = &starter.driver {
        let list = |words: &[String]| toml::Value::from(words.to_vec());
        let _ = write!(
            text,
            "\n[driver]   # docs/EGOS.md, \"A planner of your own\"\ncommand = {}   # started in the folder of this file\n\
             files = {}   # its identity: add every file whose change would change a decision\n\
             cassette = \"{}.rollouts.jsonl.zst\"   # its recorded rollouts\n",
            list(&driver.command),
            list(&driver.files),
            starter.name
        );
    }
    Ok(text)
}

/// How a model of the user's is named; nothing of it holds before the marks are taken off.
const MODEL: &str = "\n# A language model of your own in place of the rules that answer every role (docs/MODELS.md has the other kinds):\n\
    # [roles]\n# actor = \"mine\"\n# repair = \"mine\"\n# [models.mine]\n# kind = \"command\"\n# model = \"mine-1\"\n\
    # provenance = \"my_model.py\"\n# unwrap = true   # takes code fences, think blocks and the like off around a reply\n\
    # command = { program = [\"python3\", \"my_model.py\"], timeout_s = 600 }\n";

/// `[scenes]` and `[split]`: a fifth of the scenes is held out, and a window sees at most 20 of the others.
fn scenes(starter: &Starter, staged: bool) -> Result<String, ExperimentError> {
    let (source, held_out, window) = match &starter.scenes {
        None if staged => return Ok(generated_groups()),
        None => (format!("count = {GENERATED}   # generated; `evodrive init --scenes` takes yours"), 4, 14),
        Some((path, pool)) => {
            let count = pool.scenes.iter().filter(|scene| usable(scene).is_ok()).count();
            if count < 2 {
                return Err(ExperimentError::Scenes(format!(
                    "{} of the {} scenes of {} can be used; evolution needs at least 2, one of them held out",
                    count,
                    pool.scenes.len(),
                    path.display()
                )));
            }
            let path = toml::Value::String(path.to_string_lossy().into_owned());
            let source = match path.as_str().is_some_and(|path| path.ends_with(".pool")) {
                true => format!("source = \"pool\"\npath = {path}"),
                false => format!("source = \"files\"\npaths = [{path}]"),
            };
            let held_out = (count / 5).max(1);
            (source, held_out, (count - held_out).min(20))
        }
    };
    Ok(format!(
        "\n[scenes]\n{source}\n\n[split]\nevolution = {{ share = 1.0 }}   # of the usable scenes that are not held out\n\
         held_out = {held_out}\nwindow = {window}   # scenes of an epoch\n"
    ))
}

/// Two routes of each traffic family: whole groups on both sides of the split.
fn generated_groups() -> String {
    "\n[scenes.options]\nroutes = [4, 5]   # of 4 to 13, in each of eight traffic families\n\n[split]\n\
     evolution = { count = 48 }   # whole groups of a family and a route, 4 scenes each\nheld_out = 16\nwindow = 48\n"
        .to_string()
}
