//! A program file as TOML for people: the same content, with comments that its family's contract gives.

use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::{NotWritten, ProgramFile, comments, parts};
use crate::adapters::Contract;
use crate::families;
use crate::objects::pointer::within;
use crate::objects::{LineageId, OperatorNode, Program, Setting, Slot};

impl ProgramFile {
    /// The file as TOML with comments. Read again it is the same file.
    ///
    /// # Errors
    /// A family that is unknown, or a value that TOML cannot hold.
    pub fn to_toml(&self) -> Result<String, NotWritten> {
        let sources = families::sources_by_hand();
        let source = sources.get(&self.family).ok_or_else(|| NotWritten::Family(self.family.to_string()))?;
        let contract = &source.contract;
        let mut text = self.head(contract)?;
        text.push_str(&parameters(contract, &self.program)?);
        text.push_str(&operators(contract, &self.program)?);
        text.push_str(&rules(contract, &self.program)?);
        text.push_str(&modules(contract, &self.program)?);
        let _ = write!(text, "\n{}\n", comments::features(contract).trim_end());
        text.push_str(&self.provenance(&source.parent)?);
        Ok(text)
    }

    fn head(&self, contract: &Contract) -> Result<String, NotWritten> {
        let mut text =
            comments::comment("", &format!("A program of the family `{}`: {}.", self.family, contract.title));
        text.push_str(&comments::comment("", &contract.describes));
        text.push_str(&comments::comment(
            "",
            "Change values, nodes, rules and expressions here; `evodrive program check` says what does not fit and where. What \
             stands behind # is made from the family's contract and is not read.",
        ));
        let _ = write!(
            text,
            "\nformat = {}\nfamily = {}\nadapter = {}   # version of the language of programs\nname = {}\n",
            inline("/format", &self.format)?,
            inline("/family", &self.family)?,
            self.contract.adapter,
            inline("/name", &self.program.solution_id)?
        );
        let made = BTreeMap::from([("digest", self.digest), ("program_hash", self.program_hash)]);
        let _ = writeln!(
            text,
            "# What this file held when it was made: leave it alone, and it tells whether something was changed by hand.\nmade = {}",
            inline("/made", &made)?
        );
        Ok(text)
    }

    /// Writes where it came from and how it is labelled: what is seldom changed.
    fn provenance(&self, published: &Program) -> Result<String, NotWritten> {
        #[derive(Serialize)]
        struct Descent<'a> {
            lineage_id: &'a LineageId,
            generation: u32,
            ancestor_chain: &'a Vec<crate::objects::Ancestor>,
            evolution_scenes: &'a std::collections::BTreeSet<crate::kernel::Digest>,
        }
        let descent = Descent {
            lineage_id: &self.program.lineage_id,
            generation: self.program.generation,
            ancestor_chain: &self.program.ancestor_chain,
            evolution_scenes: &self.evolution_scenes,
        };
        let mut text = String::from("\n# Where it came from, and on which scenes it was evolved.\n");
        text.push_str(&table("descent", &descent)?);
        for origin in &self.origins {
            let origins = BTreeMap::from([("origins", [origin])]);
            let _ = write!(text, "\n{}", document("/origins", &origins)?);
        }
        if !self.parent_settings.is_empty() {
            text.push('\n');
            text.push_str(&table("parent_settings", &self.parent_settings)?);
        }
        text.push_str(
            "\n# How it is labelled: driver, seed, simulator, what counts as an attack, tolerances of realism.\n",
        );
        text.push_str(&table("conditions", &self.conditions)?);
        if self.parent != published.adopted(&self.program.lineage_id) {
            text.push_str("\n# What its lineage started from: `apply` compares with it.\n");
            text.push_str(&table("parent", &self.parent)?);
        }
        if !self.counsel.is_empty() {
            text.push('\n');
            text.push_str(&table("counsel", &self.counsel)?);
        }
        if !self.sequences.is_empty() {
            text.push_str(
                "\n# Control sequences of SafeBench that are played in place of a search, by traffic family.\n",
            );
            text.push_str(&table("sequences", &self.sequences)?);
        }
        Ok(text)
    }
}

fn parameters(contract: &Contract, program: &Program) -> Result<String, NotWritten> {
    let mut text = String::from(
        "\n# Parameters: settings name them by { parameter = name }, and expressions read those that are numbers.\n[parameters]\n",
    );
    for (name, value) in &program.parameters {
        if let Some(spec) = contract.parameters.get(name) {
            text.push_str(&comments::comment("", &comments::value(&spec.domain, &spec.describes)));
        }
        let _ = writeln!(text, "{} = {}", key(name), inline(&within("/parameters", name), value)?);
    }
    Ok(text)
}

fn operators(contract: &Contract, program: &Program) -> Result<String, NotWritten> {
    let mut text = String::from(
        "\n# Operators, in the order in which a scene passes them. `inputs` names the nodes that feed a node.\n",
    );
    for slot in Slot::ALL {
        let kinds = contract.operators.get(&slot).map(Vec::as_slice).unwrap_or_default();
        let nodes: Vec<_> = program.operator_graph.iter().filter(|(_, node)| node.slot == slot).collect();
        if kinds.is_empty() && nodes.is_empty() {
            continue;
        }
        let _ = write!(text, "\n{}", comments::slot(slot, kinds));
        for (name, of) in nodes {
            text.push_str(&node(contract, name, of)?);
        }
    }
    Ok(text)
}

fn node(contract: &Contract, name: &str, of: &OperatorNode) -> Result<String, NotWritten> {
    let place = within("/operator_graph", name);
    let head = format!("operator_graph.{}", key(name));
    let mut text = format!("\n[{head}]\nslot = \"{}\"\nkind = {}\n", of.slot.name(), inline(&place, &of.kind)?);
    if !of.inputs.is_empty() {
        let _ = writeln!(text, "inputs = {}", inline(&place, &of.inputs)?);
    }
    let spec = contract.operator(of.slot, &of.kind);
    let declared = spec.map(|spec| &spec.settings);
    if !of.settings.is_empty() {
        let _ = writeln!(text, "[{head}.settings]");
    }
    for (setting, value) in &of.settings {
        if let Some(spec) = declared.and_then(|declared| declared.get(setting)) {
            text.push_str(&comments::comment("", &comments::value(&spec.domain, &spec.describes)));
        }
        let _ = writeln!(text, "{} = {}", key(setting), self::setting(&place, value)?);
    }
    let unset = declared.into_iter().flatten().filter(|(setting, _)| !of.settings.contains_key(*setting));
    unset.for_each(|(setting, spec)| text.push_str(&comments::unset(setting, spec)));
    Ok(text)
}

/// References with blanks inside their braces, as people write them.
fn setting(place: &str, value: &Setting) -> Result<String, NotWritten> {
    Ok(match value {
        Setting::Parameter(of) => format!("{{ parameter = {} }}", inline(place, &of.parameter)?),
        Setting::Mechanism(of) => format!("{{ mechanism = {} }}", inline(place, &of.mechanism)?),
        plain => inline(place, plain)?,
    })
}

fn rules(contract: &Contract, program: &Program) -> Result<String, NotWritten> {
    let mut text = format!("\n{}", comments::rules(contract));
    for (index, rule) in program.scenario_conditioned_policy.iter().enumerate() {
        let place = within("/scenario_conditioned_policy", &index.to_string());
        let (name, when) = (inline(&place, &rule.name)?, inline(&place, &rule.when)?);
        let _ = write!(text, "\n[[scenario_conditioned_policy]]\nname = {name}\nwhen = {when}\n");
        if !rule.parameters.is_empty() {
            let _ = writeln!(text, "parameters = {}", inline(&place, &rule.parameters)?);
        }
        if !rule.operators.is_empty() {
            let _ = writeln!(text, "operators = {}", inline(&place, &rule.operators)?);
        }
    }
    Ok(text)
}

fn modules(contract: &Contract, program: &Program) -> Result<String, NotWritten> {
    let mut text = format!("\n{}", comments::mechanism_slots(contract));
    for (name, module) in &program.mechanism_modules {
        let place = within("/mechanism_modules", name);
        let _ = write!(
            text,
            "\n[mechanism_modules.{}]\nslot = {}\noutput = {}\nexpression = {}\n",
            key(name),
            inline(&place, &module.slot)?,
            inline(&place, &module.output)?,
            inline(&place, &module.expression)?
        );
        // What the expression reads in the order of names is what stands for inputs that are left out.
        if module.inputs != parts::names_read(&module.expression) {
            let _ = writeln!(text, "inputs = {}", inline(&place, &module.inputs)?);
        }
        if !module.tags.is_empty() {
            let _ = writeln!(text, "tags = {}", inline(&place, &module.tags)?);
        }
    }
    Ok(text)
}

/// A name as a key.
fn key(name: &str) -> String {
    let bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if !name.is_empty() && name.chars().all(bare) {
        name.to_string()
    } else {
        toml::Value::String(name.to_string()).to_string()
    }
}

fn unfit(place: &str) -> impl Fn(toml::ser::Error) -> NotWritten {
    let place = place.to_string();
    move |error| NotWritten::Value { place: place.clone(), reason: error.to_string() }
}

/// A value on one line.
fn inline<T: Serialize + ?Sized>(place: &str, value: &T) -> Result<String, NotWritten> {
    Ok(toml::Value::try_from(value).map_err(unfit(place))?.to_string())
}

/// A table of its own with all that is below it.
fn table<T: Serialize>(name: &str, value: &T) -> Result<String, NotWritten> {
    document(&format!("/{name}"), &BTreeMap::from([(name, value)]))
}

fn document<T: Serialize>(place: &str, value: &T) -> Result<String, NotWritten> {
    toml::to_string(&toml::Value::try_from(value).map_err(unfit(place))?).map_err(unfit(place))
}
