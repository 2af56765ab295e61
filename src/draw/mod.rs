//! Pictures of scenes and rollouts: an SVG, and a page that plays them without a network.

mod drawing;
mod player;
mod strip;
mod svg;

pub use drawing::{Actor, Contact, Drawing, DrawnLight, LineStyle, RoadLine, Role, role_of};
pub use player::{PLAYER_CSS, PLAYER_JS, escaped, player_html, players_html, script_json};
pub use strip::{StripOptions, even_steps, strip};
pub use svg::{Frame, SvgOptions, Theme, svg};

#[cfg(test)]
mod tests;
