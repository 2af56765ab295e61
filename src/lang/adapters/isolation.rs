//! Words of other families, for which the isolation gate searches.

use std::collections::{BTreeMap, BTreeSet};

use super::contract::{Contract, Domain, Family};
use crate::objects::FamilyName;

/// A word that belongs to another family's implementation.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ForeignWord {
    /// The word.
    pub word: String,
    /// The family that it belongs to.
    pub family: FamilyName,
}

impl Contract {
    /// Every word that the family itself declares: parameters, kinds, settings, slots, features, choices.
    pub fn vocabulary(&self) -> BTreeSet<&str> {
        let mut words: BTreeSet<&str> = self.private_vocabulary.iter().map(String::as_str).collect();
        for (name, spec) in &self.parameters {
            words.insert(name);
            words.extend(options(&spec.domain));
        }
        for spec in self.operators.values().flatten() {
            words.insert(&spec.kind);
            for (name, setting) in &spec.settings {
                words.insert(name);
                words.extend(options(&setting.domain));
            }
        }
        for (name, slot) in &self.mechanism_slots {
            words.insert(name);
            words.extend(slot.features.iter().map(|feature| feature.name));
        }
        words.extend(self.scene_features.iter().map(|feature| feature.name));
        words
    }

    /// Words that are private to another family and not also this one's, with the family that owns them.
    pub fn foreign_vocabulary<'a>(&self, families: impl IntoIterator<Item = &'a Family>) -> ForeignVocabulary {
        let own = self.vocabulary();
        let others = families.into_iter().map(|family| &family.contract).filter(|other| other.family != self.family);
        let private = others
            .flat_map(|other| other.private_vocabulary.iter().map(move |word| (word.clone(), other.family.clone())))
            .filter(|(word, _)| !own.contains(word.as_str()))
            .collect();
        ForeignVocabulary { private }
    }
}

/// The words that a family may not use.
#[derive(Clone, Debug)]
pub struct ForeignVocabulary {
    private: BTreeMap<String, FamilyName>,
}

impl ForeignVocabulary {
    /// The foreign words in the texts (names, kinds, expressions, keys, paths), sorted, each once. Texts are split into
    /// identifiers, so a foreign word inside an expression is found too.
    pub fn words_in<'a>(&self, texts: impl IntoIterator<Item = &'a str>) -> BTreeSet<ForeignWord> {
        let words = texts.into_iter().flat_map(identifiers);
        words
            .filter_map(|word| self.private.get(word).map(|family| (word, family)))
            .map(|(word, family)| ForeignWord { word: word.into(), family: (*family).clone() })
            .collect()
    }
}

fn options(domain: &Domain) -> impl Iterator<Item = &str> {
    let options: &[String] = if let Domain::Choice { options } = domain { options } else { &[] };
    options.iter().map(String::as_str)
}

/// The maximal runs of letters, digits and `_`.
pub fn identifiers(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).filter(|word| !word.is_empty())
}
