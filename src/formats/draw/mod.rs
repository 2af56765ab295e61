//! Pictures of scenes and rollouts: an SVG, a film, and a page that plays them without a network; figures of numbers as SVG and PDF.

mod arimo;
mod axes;
mod browse;
mod drawing;
mod figure;
mod figure_pdf;
mod film;
mod grid;
mod helvetica;
mod lettering;
mod panel;
mod player;
mod strip;
mod svg;

pub use axes::{Axes, Scale, tick_text};
pub use browse::{Card, Plan, browse_html};
pub use drawing::{Actor, Contact, Drawing, DrawnLight, LineStyle, RoadLine, Role, role_of};
pub use figure::{
    Anchor, BLACK, BLUE, Figure, GREEN, GREY, Ink, LIGHT, Mark, ORANGE, PURPLE, Rgb, SKY, Shape, VERMILION, WHITE,
    Words, YELLOW,
};
pub use figure_pdf::{PdfError, in_font, pdf};
pub use film::{Film, FilmError, FilmOptions, film, gif};
pub use grid::{Cell, GridOptions, grid};
pub use helvetica::{whole_sentences, width, wrapped};
pub use panel::{Panel, colour, panel, roles_in};
pub use player::{PLAYER_CSS, PLAYER_JS, beside_html, escaped, player_html, players_below, players_html, script_json};
pub use strip::{StripOptions, even_steps, strip, strip_figure, strips};
pub use svg::{Frame, SvgOptions, Theme, svg};

#[cfg(test)]
mod tests;
