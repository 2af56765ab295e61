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
    let mount = "EvoPlayer.mount(document.getElementById(\"player\"), \
                 JSON.parse(document.getElementById(\"drawing\").textContent), { fill: true });";
    page(title, "", &script_json(drawing), mount)
}

/// The page that shows one of several drawings at a time, each with the line under which it is chosen.
pub fn players_html(drawings: &[(String, Drawing)], title: &str) -> String {
    players_below("", drawings, title)
}

/// The same below a piece of HTML, in which a button with `data-play` chooses the drawing of that place.
pub fn players_below(above: &str, drawings: &[(String, Drawing)], title: &str) -> String {
    let choice = "<p><label>Scene <select id=\"choice\"></select></label></p>\n";
    let mount = "const all = JSON.parse(document.getElementById(\"drawing\").textContent);\n\
                 const choice = document.getElementById(\"choice\"), player = document.getElementById(\"player\");\n\
                 all.forEach(([line], k) => choice.append(new Option(line, k)));\n\
                 let shown = null;\n\
                 const show = () => { if (shown) shown.destroy(); shown = EvoPlayer.mount(player, all[choice.value][1], { fill: true }); };\n\
                 choice.addEventListener(\"change\", show);\nif (all.length) show();\n\
                 document.addEventListener(\"click\", ({ target }) => { if (target.dataset.play === undefined) return;\n\
                 choice.value = target.dataset.play; show(); player.scrollIntoView({ behavior: \"smooth\" }); });";
    page(title, &format!("{above}{choice}"), &script_json(drawings), mount)
}

/// The page that shows drawings beside each other, each below its line.
pub fn beside_html(drawings: &[(String, Drawing)], title: &str) -> String {
    let above = "<style>#all { display: flex; flex-wrap: wrap; gap: 1rem; padding-bottom: 1rem } #all > div { flex: 1 1 24rem; min-width: 0 } \
                 #all .evo-stage { flex: none; height: clamp(320px, 62vh, 640px) }</style><div id=\"all\"></div>\n";
    let mount = "const all = JSON.parse(document.getElementById(\"drawing\").textContent);\n\
                 document.getElementById(\"player\").remove();\n\
                 all.forEach(([line, drawing]) => {\n\
                 const one = document.createElement(\"div\"), head = document.createElement(\"p\"), place = document.createElement(\"div\");\n\
                 head.textContent = line; place.className = \"evo-player\"; one.append(head, place);\n\
                 document.getElementById(\"all\").append(one); EvoPlayer.mount(place, drawing, {}); });";
    page(title, above, &script_json(drawings), mount)
}

fn page(title: &str, above: &str, data: &str, mount: &str) -> String {
    let title = escaped(title);
    let above = match above {
        "" => String::new(),
        above => format!("<div class=\"evo-above\">\n{above}</div>\n"),
    };
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{title}</title>\n\
         <style>\n{PLAYER_CSS}\n</style>\n</head>\n<body class=\"evo-page\">\n<h1>{title}</h1>\n{above}\
         <div id=\"player\" class=\"evo-player\"></div>\n\
         <noscript>This page draws with a script; the scene's SVG shows it without one.</noscript>\n\
         <script type=\"application/json\" id=\"drawing\">{data}</script>\n<script>\n{PLAYER_JS}\n\
         {mount}\n</script>\n</body>\n</html>\n"
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
