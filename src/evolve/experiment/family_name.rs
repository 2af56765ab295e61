//! A source family as it is typed: in any case, and with a dash or a blank in place of a low line, as papers write ADV-BMT.

use toml::{Table, Value};

use crate::families;

/// The name of the family that is meant; a word that means none stays as it is.
pub fn family_named(word: &str) -> String {
    let folded = word.trim().to_lowercase().replace(['-', ' '], "_");
    let known = families::sources().iter().any(|source| source.contract.family.as_str() == folded);
    if known { folded } else { word.to_string() }
}

/// Writes the families of an experiment's lineages as the program names them: the digest knows one spelling.
pub fn spell(table: &mut Table) {
    let lineages = table.get_mut("lineage").and_then(Value::as_array_mut).into_iter().flatten();
    for family in lineages.filter_map(|lineage| lineage.get_mut("family")) {
        if let Value::String(word) = family {
            *word = family_named(word);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_family_is_meant_in_any_case_and_with_dashes() {
        for (typed, meant) in
            [("cat", "cat"), ("CAT", "cat"), ("adv-bmt", "adv_bmt"), ("ADV_BMT", "adv_bmt"), ("Adv BMT", "adv_bmt")]
        {
            assert_eq!(family_named(typed), meant);
        }
        assert_eq!(family_named("CATT"), "CATT");
    }

    #[test]
    fn the_families_of_lineages_are_spelled_as_the_program_does() {
        let mut table: Table = "[[lineage]]\nfamily = \"ADV-BMT\"\n[[lineage]]\nfamily = \"nobody\"".parse().unwrap();
        spell(&mut table);
        let families = |i: usize| table["lineage"][i]["family"].as_str().unwrap().to_string();
        assert_eq!([families(0), families(1)], ["adv_bmt", "nobody"]);
    }
}
