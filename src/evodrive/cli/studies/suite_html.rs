//! Parts that pages of suites have in common: how tables look, and the body of a page without a player.

use crate::draw::escaped;

/// How tables of suites look.
pub const STYLE: &str = "<style>.wide { overflow-x: auto } table.suite { border-collapse: collapse; font-size: 14px; margin: 0 0 1rem } \
                     table.suite th, table.suite td { text-align: left; padding: 3px 9px; border-bottom: 1px solid #8886; \
                     overflow-wrap: normal } table.suite th { white-space: nowrap } .broken { color: #c0392b; font-weight: 600 } \
                     .worst { margin: 0 0 1rem } .worst div { overflow-x: auto } .worst svg { width: 100%; min-width: 640px; height: auto; max-height: 46vh } \
                     @media (max-width: 700px) { .wide.many::before { content: \"scroll sideways for the rest →\"; font-size: 13px } }</style>\n";

/// Head of a page of suites that has no player.
pub const BODY: &str = "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
                    <style>body { margin: 0 auto; max-width: 1180px; padding: 16px 20px; overflow-wrap: anywhere; \
                    font: 15px/1.5 system-ui, \"Segoe UI\", \"DejaVu Sans\", sans-serif } h1 { font-size: 22px; margin: 0 0 4px }</style>\n";
/// Number of columns from which on a table is wider than a telephone.
const MANY: usize = 5;

/// A table of texts.
pub fn table(heads: &[String], rows: &[Vec<String>]) -> String {
    // An estimate may be broken before its interval, and not in it.
    let kept = |cell: &String| if cell.contains(" [") { escaped(cell).replace(", ", ",&#160;") } else { escaped(cell) };
    let line = |cells: &[String], tag: &str| -> String {
        let cells = cells.iter().map(|cell| format!("<{tag}>{}</{tag}>", kept(cell))).collect::<String>();
        format!("<tr>{cells}</tr>\n")
    };
    let rows: String = rows.iter().map(|row| line(row, "td")).collect();
    let many = if heads.len() >= MANY { " many" } else { "" };
    format!("<div class=\"wide{many}\"><table class=\"suite\">\n{}{rows}</table></div>\n", line(heads, "th"))
}
