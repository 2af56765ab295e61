//! Finds numbers that somebody typed into the text of the paper, and names of numbers that no golden holds: each must come from one.

/// A number in the text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Typed {
    /// Line, from 1.
    pub line: usize,
    /// The number with what stands around it.
    pub text: String,
}

/// Commands whose arguments hold names, lengths and files, no results.
const NAMES: [&str; 21] = [
    "evo",
    "evonumber",
    "evostack",
    "cite",
    "eqref",
    "multicolumn",
    // Rows of a table that is put together from numbers, by their names.
    "evorow",
    // A number of a definition, which no run measures.
    "const",
    "input",
    "includegraphics",
    "label",
    "ref",
    "documentclass",
    "usepackage",
    "texttt",
    "url",
    "vspace",
    "hspace",
    "setlength",
    "begin",
    "end",
];

/// The numbers of a LaTeX document that stand in its text: digits outside of comments, of names of commands, and of the arguments of
/// commands that take names. `PF-Area@3`, `#1` and `[3]` are words, `2 seeds` is a number.
pub fn typed_numbers(text: &str) -> Vec<Typed> {
    let letters: Vec<char> = text.chars().collect();
    let (mut at, mut line, mut found) = (0, 1, Vec::new());
    while at < letters.len() {
        match letters[at] {
            '\n' => line += 1,
            '%' => {
                at += letters[at..].iter().take_while(|c| **c != '\n').count();
                continue;
            }
            '\\' => {
                let name: String = letters[at + 1..].iter().take_while(|c| c.is_ascii_alphabetic()).collect();
                at += 1 + name.len().max(1);
                if NAMES.contains(&name.as_str()) {
                    let (after, lines) = behind_arguments(&letters, at);
                    (at, line) = (after, line + lines);
                }
                continue;
            }
            c if c.is_ascii_digit() => {
                let before = at.checked_sub(1).map(|before| letters[before]);
                let number: String =
                    letters[at..].iter().take_while(|c| c.is_ascii_digit() || matches!(c, '.' | ',')).collect();
                let word = before.is_some_and(|c| {
                    c.is_alphabetic()
                        || matches!(c, '_' | '@' | '#' | '[')
                        || c == '-' && at > 1 && letters[at - 2].is_alphabetic()
                });
                if !word {
                    let from = at.saturating_sub(20);
                    let text: String = letters[from..letters.len().min(at + 20)].iter().collect();
                    found.push(Typed { line, text: text.replace('\n', " ") });
                }
                at += number.chars().count();
                continue;
            }
            _ => {}
        }
        at += 1;
    }
    found
}

/// The `\evo{...}`, `\evonumber{...}` and `\evostack{...}` of a LaTeX document whose name the numbers, as [`numbers`](super::numbers) writes them, do not define. LaTeX
/// stops there, but only where it is installed.
pub fn unknown_numbers(text: &str, numbers: &str) -> Vec<Typed> {
    let mut typed = Vec::new();
    for (at, line) in text.lines().enumerate() {
        let printed =
            line.split_once('%').filter(|(before, _)| !before.ends_with('\\')).map_or(line, |(before, _)| before);
        let named = ["\\evo{", "\\evonumber{", "\\evostack{"];
        let names = named.iter().flat_map(|command| printed.split(command).skip(1));
        // A name with a parameter is put together by LaTeX, which stops where there is none of it.
        for name in names.filter_map(|rest| rest.split('}').next()).filter(|name| !name.contains('#')) {
            if !numbers.contains(&format!("\\csname evo:{name}\\endcsname")) {
                typed.push(Typed { line: at + 1, text: name.to_string() });
            }
        }
    }
    typed
}

/// Place behind the arguments in brackets and braces that follow, and how many lines they span.
fn behind_arguments(letters: &[char], mut at: usize) -> (usize, usize) {
    let mut lines = 0;
    while let Some(open) = letters.get(at) {
        let close = match open {
            '{' => '}',
            '[' => ']',
            _ => break,
        };
        let mut depth = 0;
        while let Some(c) = letters.get(at) {
            lines += usize::from(*c == '\n');
            depth += i32::from(c == open) - i32::from(*c == close);
            at += 1;
            if depth == 0 {
                break;
            }
        }
    }
    (at, lines)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_typed_number_is_found_with_its_line() {
        let typed = typed_numbers("All well.\nAttack rose by 0.25 here.\n");
        assert_eq!((typed.len(), typed[0].line), (1, 2));
        assert!(typed[0].text.contains("0.25"));
        assert_eq!(typed_numbers("$p < 0.05$ and 12\\%").len(), 2);
    }

    #[test]
    fn names_files_comments_and_macros_are_no_numbers() {
        for text in [
            "\\evo{metadrive-main:CAT:attack}",
            "\\includegraphics[width=0.9\\linewidth]{../golden/paper/fig-1.pdf}",
            "% 42 in a comment",
            "PF-Area@3 is a name",
            "\\begin{tabular}{p{2cm}}",
            "the model GPT4 and R2",
        ] {
            let left = typed_numbers(text);
            assert!(left.is_empty(), "{text}: {left:?}");
        }
    }

    #[test]
    fn every_number_that_the_paper_names_is_there() {
        let numbers = include_str!("../../../../golden/paper/numbers.tex");
        let typed = unknown_numbers(include_str!("../../../../paper/evodrive.tex"), numbers);
        assert!(typed.is_empty(), "{typed:?}");
        let text =
            "10 \\% of \\evo{claims:all}\n% \\evo{in a comment}\nso \\evo{claims:non} and \\evo{claims:tested}\n";
        assert_eq!(unknown_numbers(text, numbers), [Typed { line: 3, text: "claims:non".into() }]);
    }

    #[test]
    fn the_paper_has_no_typed_number() {
        let typed = typed_numbers(include_str!("../../../../paper/evodrive.tex"));
        assert!(typed.is_empty(), "{typed:?}");
    }
}
