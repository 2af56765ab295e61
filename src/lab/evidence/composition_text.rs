//! The composition of one template as text: what was described, what was asked and answered, and what came of it.

use std::fmt::Write as _;

use super::attempt_text::{Exchanged, exchanges};
use crate::objects::{Composed, Exchange};
use crate::text::counted;

/// The whole story of a composition. `texts` gives prompt and reply of an exchange; `full` prints prompts uncut.
pub fn composition(composed: &Composed, texts: &dyn Fn(&Exchange) -> Option<Exchanged>, full: bool) -> String {
    let mut out = format!("template {} of {}\ndescribed: {}\n", composed.kind, composed.lineage, composed.description);
    exchanges(&mut out, &composed.exchanges, texts, full);
    for (place, trial) in composed.trials.iter().enumerate() {
        let realism = trial.realism.map_or("none".into(), |realism| format!("{realism:.3}"));
        let _ = writeln!(
            out,
            "\ntried {}: {}: the ego failed in {} of {}, the road user acted in {}, realism {realism}",
            place + 1,
            trial.template.behaviour,
            trial.collided,
            counted(trial.scenes, "scene"),
            trial.acted
        );
    }
    let Some(template) = &composed.template else {
        out.push_str("\nno answer could be used, so the published template is kept\n");
        return out;
    };
    let _ = writeln!(out, "\ncomposed: {}\n     {}", template.behaviour, template.reason);
    for (name, [low, high]) in &template.ranges {
        let _ = writeln!(out, "  {name:<14} {low} to {high}");
    }
    out
}
