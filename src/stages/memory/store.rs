//! The card store: append-only, each card stamped with the epoch after which it exists.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use crate::objects::{Card, CardId, LineageId};

/// Q_t: all cards in order of writing. Only the serial acceptor appends, once after an epoch's barrier.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Memory {
    cards: Vec<Card>,
}

/// Why cards were refused; none of them was appended.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MemoryError {
    /// There is a card of this id already.
    #[error("card {0} exists already; a card id names one card and cards are never changed")]
    Twice(CardId),
    /// A card comes after cards of a later epoch of its lineage.
    #[error("card {card} says epoch {epoch}, lineage {lineage} has cards of epoch {last}; the past is closed")]
    Backdated {
        /// The card.
        card: CardId,
        /// Its lineage.
        lineage: LineageId,
        /// Its epoch.
        epoch: u32,
        /// The latest epoch that the lineage has cards of.
        last: u32,
    },
}

impl Memory {
    /// Q_{t+1} = Q_t ∪ C(a_t). Appends all cards or none. A card may not be older than the newest card of its lineage.
    pub fn append(&mut self, cards: Vec<Card>) -> Result<(), MemoryError> {
        let mut known: std::collections::BTreeSet<&CardId> = self.cards.iter().map(|card| &card.id).collect();
        let mut newest: BTreeMap<&LineageId, u32> = BTreeMap::new();
        for card in &self.cards {
            newest.insert(&card.lineage, card.epoch);
        }
        for card in &cards {
            if !known.insert(&card.id) {
                return Err(MemoryError::Twice(card.id.clone()));
            }
            let last = newest.insert(&card.lineage, card.epoch).unwrap_or(card.epoch);
            if card.epoch < last {
                return Err(MemoryError::Backdated {
                    card: card.id.clone(),
                    lineage: card.lineage.clone(),
                    epoch: card.epoch,
                    last,
                });
            }
        }
        self.cards.extend(cards);
        Ok(())
    }

    /// All cards, in the order in which they were added.
    pub fn cards(&self) -> &[Card] {
        &self.cards
    }

    /// The card of this id.
    pub fn card(&self, id: &CardId) -> Option<&Card> {
        self.cards.iter().find(|card| card.id == *id)
    }
}
