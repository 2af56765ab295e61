//! An HTML page that plays a drawing in a browser, offline: it contains script, style and data.

use serde::Serialize;

use super::drawing::Drawing;

/// `EvoPlayer.mount(element, drawing, options)`: a player in any page. `options` may hold `autoplay` (bool)
/// and `follow` (bool).
pub const PLAYER_JS: &str = include_str!("assets/player.js");

/// Style of what [`PLAYER_JS`] builds; everything is below `.evo-player`, colours follow the reader's scheme.
pub const PLAYER_CSS: &str = include_str!("assets/player.css");

/// The page that shows one drawing.
pub fn player_html(drawing: &Drawing, title: &str) -> String {
    let title = escaped(title);
    let data = script_json(drawing);
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{title}</title>\n\
         <style>\n{PLAYER_CSS}\n</style>\n</head>\n<body class=\"evo-page\">\n<h1>{title}</h1>\n\
         <div id=\"player\" class=\"evo-player\"></div>\n\
         <noscript>This page draws with a script; the scene's SVG shows it without one.</noscript>\n\
         <script type=\"application/json\" id=\"drawing\">{data}</script>\n<script>\n{PLAYER_JS}\n\
         EvoPlayer.mount(document.getElementById(\"player\"), \
         JSON.parse(document.getElementById(\"drawing\").textContent), {{ fill: true }});\n</script>\n</body>\n</html>\n"
    )
}

/// JSON that may stand inside a `<script>` element: no tag can end it early.
pub fn script_json<T: Serialize + ?Sized>(value: &T) -> String {
    // This could fail only for maps whose keys are not strings, or if the writer failed.
    let json = serde_json::to_string(value).unwrap_or_else(|_| "null".to_string());
    json.replace('<', "\\u003c").replace('\u{2028}', "\\u2028").replace('\u{2029}', "\\u2029")
}

/// Text that may stand in HTML or XML.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
