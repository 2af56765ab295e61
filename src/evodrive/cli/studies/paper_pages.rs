//! Builds the PDF of the paper where LaTeX is installed, and looks at its pages.

use std::path::Path;
use std::time::Duration;

use crate::cli::cluster::worker_process::Processes;
use crate::cli::terminal::answer::progress;
use crate::cli::terminal::exit::Failure;
use crate::evidence::paper::{
    FIGURE_TEXT_PT, figures_of, overfull, pages_of, smallest_text_pt, unsound_fonts, unsound_pages,
};
use crate::llm::command::{Ended, Run};
use crate::store::{self, Scratch};

/// Name of the text, without ending.
const TEXT: &str = "evodrive";
/// Bytes of a file that is read back, and the time that one program may take.
const BYTES_MAX: u64 = 1 << 26;
const LIMIT: Duration = Duration::from_secs(300);
/// Long tables find their widths and places in three runs.
const RUNS: usize = 3;
/// Points an inch of the small pictures.
const DOTS: &str = "18";
/// Debian's command to install what is needed.
const PACKAGES: &str =
    "apt-get install --no-install-recommends texlive-latex-recommended texlive-fonts-recommended poppler-utils";

/// Result of looking at the pages.
pub struct Seen {
    /// Faults, a line each.
    pub wrong: Vec<String>,
    /// Pages that could be looked at, or the reason why not.
    pub about: String,
}

/// A program that is not there is no error of the paper.
enum Ran {
    Well,
    Absent,
    Failed(String),
}

fn ran(command: &[&str]) -> Ran {
    let command: Vec<String> = command.iter().map(|word| word.to_string()).collect();
    match Processes::default().run(&command, Vec::new(), LIMIT) {
        Ended::Well(_) => Ran::Well,
        Ended::Unstarted(_) | Ended::Badly { code: Some(127), .. } => Ran::Absent,
        Ended::Badly { stderr, .. } => Ran::Failed(stderr),
        Ended::Late { .. } => Ran::Failed(format!("it took longer than {} s", LIMIT.as_secs())),
        Ended::Stopped => Ran::Failed("it was stopped".into()),
        Ended::Unread(reason) => Ran::Failed(reason),
    }
}

fn skipped(what: &str) -> Seen {
    let about = format!("pages not looked at: {what} is not installed (Debian: {PACKAGES})");
    progress(&about);
    Seen { wrong: Vec::new(), about }
}

/// Builds the text of a folder and looks at its pages; figures are those of the goldens.
pub fn look(paper: &Path, golden: &Path) -> Result<Seen, Failure> {
    let scratch = Scratch::under(&std::env::temp_dir(), "evodrive-paper-")?;
    let out = scratch.dir.display().to_string();
    let folder = paper.display().to_string();
    // LaTeX reads files beside the text from where it is started, and cuts the lines of its log unless told otherwise.
    let script = format!(
        "cd \"$0\" && max_print_line=1000 exec pdflatex -interaction=nonstopmode -halt-on-error -output-directory \"$1\" {TEXT}.tex"
    );
    let log_file = scratch.dir.join(format!("{TEXT}.log"));
    for _ in 0..RUNS {
        match ran(&["sh", "-c", &script, &folder, &out]) {
            Ran::Well => {}
            Ran::Absent => return Ok(skipped("pdflatex")),
            Ran::Failed(reason) => {
                let log = if log_file.exists() { text_of(&log_file)? } else { reason };
                let from = log.lines().position(|line| line.starts_with('!')).unwrap_or(0);
                let said: Vec<&str> = log.lines().skip(from).take(6).collect();
                let wrong = vec![format!("{folder}/{TEXT}.tex: pdflatex stops: {}", said.join(" / "))];
                return Ok(Seen { wrong, about: "no PDF could be built".into() });
            }
        }
    }
    let log = text_of(&log_file)?;
    let mut wrong: Vec<String> = overfull(&log).into_iter().map(|line| format!("{TEXT}.tex: {line}")).collect();
    wrong.extend(undefined(&log));
    for used in figures_of(&log) {
        let file = golden.join("paper").join(format!("{}.pdf", used.name));
        let smallest = smallest_text_pt(&store::read_bounded(&file, BYTES_MAX)?, used.width_pt);
        if let Some(size) = smallest.filter(|size| *size < FIGURE_TEXT_PT) {
            wrong.push(format!("figure {}: letters of {size:.1} pt; expected {FIGURE_TEXT_PT} pt or more", used.name));
        }
    }
    let pdf = scratch.dir.join(format!("{TEXT}.pdf")).display().to_string();
    let (listing, boxes) = (scratch.dir.join("fonts.txt"), scratch.dir.join("words.html"));
    let fonts = format!("pdffonts \"$0\" > \"{}\"", listing.display());
    for (program, command) in [
        ("pdffonts", vec!["sh", "-c", fonts.as_str(), pdf.as_str()]),
        ("pdftotext", vec!["pdftotext", "-bbox", pdf.as_str(), &boxes.display().to_string()]),
        ("pdftoppm", vec!["pdftoppm", "-gray", "-r", DOTS, pdf.as_str(), &format!("{out}/page")]),
    ] {
        match ran(&command) {
            Ran::Well => {}
            Ran::Absent => return Ok(Seen { wrong, ..skipped(program) }),
            Ran::Failed(reason) => return Err(Failure::internal(format!("{program}: {}", reason.trim()))),
        }
    }
    wrong.extend(unsound_fonts(&text_of(&listing)?));
    let pictures: Vec<Vec<u8>> = store::list_files(&scratch.dir, &["pgm"])?
        .iter()
        .map(|file| store::read_bounded(file, BYTES_MAX))
        .collect::<Result<_, _>>()?;
    let pages = pages_of(&text_of(&boxes)?, &pictures);
    wrong.extend(unsound_pages(&pages));
    Ok(Seen { wrong, about: format!("{} pages looked at", pages.len()) })
}

/// References that lead nowhere.
fn undefined(log: &str) -> Vec<String> {
    let is_one = |line: &&str| line.starts_with("LaTeX Warning: ") && line.contains("undefined on input line");
    log.lines()
        .filter(is_one)
        .map(|line| format!("{TEXT}.tex: {}", line.trim_start_matches("LaTeX Warning: ")))
        .collect()
}

fn text_of(path: &Path) -> Result<String, Failure> {
    Ok(String::from_utf8_lossy(&store::read_bounded(path, BYTES_MAX)?).into_owned())
}
