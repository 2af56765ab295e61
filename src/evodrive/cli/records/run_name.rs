//! How a command is told which run is meant: in its place or as `--run`, by path, by name below runs/, or by the beginning of
//! either. Every command that takes a run takes it from here.

use clap::Args;
use std::path::{Path, PathBuf};

use crate::cli::records::folder::{CARD_BYTES_MAX, LATEST, RUNS, RunFolder};
use crate::cli::terminal::exit::Failure;
use crate::experiment::did_you_mean;
use crate::store;

/// Runs that a message lists before it counts.
const LISTED_MAX: usize = 8;

/// At most one run.
#[derive(Clone, Debug, Default, Args)]
pub struct OneRun {
    /// Run: its folder, its name below runs/, or the beginning of either; without it the latest.
    #[arg(value_name = "RUN")]
    run: Option<PathBuf>,
    /// The same as an option.
    #[arg(id = "run_option", long = "run", value_name = "RUN", conflicts_with = "run")]
    option: Option<PathBuf>,
}

impl OneRun {
    /// As it was typed, if it was.
    pub fn named(&self) -> Option<&Path> {
        self.run.as_deref().or(self.option.as_deref())
    }

    /// A run that the program names itself.
    pub fn of(dir: &Path) -> OneRun {
        OneRun { run: Some(dir.to_path_buf()), option: None }
    }

    /// The run's folder, or the latest one.
    pub fn folder(&self) -> Result<RunFolder, Failure> {
        RunFolder::find(self.named())
    }

    /// The run's folder; where none is named the one that is not finished, and the latest one where all are.
    pub fn unfinished_or_latest(&self) -> Result<RunFolder, Failure> {
        match self.named() {
            None => RunFolder::unfinished()?.map_or_else(|| RunFolder::find(None), Ok),
            named => RunFolder::find(named),
        }
    }
}

/// Any number of runs.
#[derive(Clone, Debug, Default, Args)]
pub struct Runs {
    /// Runs: their folders, their names below runs/, or the beginnings of either; without one the latest.
    #[arg(value_name = "RUN")]
    run: Vec<PathBuf>,
    /// The same as an option; may be given again.
    #[arg(id = "run_option", long = "run", value_name = "RUN")]
    option: Vec<PathBuf>,
}

impl Runs {
    /// As they were typed: those in their places first.
    pub fn named(&self) -> impl Iterator<Item = &Path> {
        self.run.iter().chain(&self.option).map(PathBuf::as_path)
    }

    /// The same behind another run, which was typed in another place.
    pub fn behind(mut self, first: &Path) -> Runs {
        self.run.insert(0, first.to_path_buf());
        self
    }

    /// Their folders, or the latest one.
    pub fn folders(&self) -> Result<Vec<RunFolder>, Failure> {
        let named: Vec<RunFolder> = self.named().map(|run| RunFolder::find(Some(run))).collect::<Result<_, _>>()?;
        if named.is_empty() { Ok(vec![RunFolder::find(None)?]) } else { Ok(named) }
    }
}

/// Two runs, the first and the second.
#[derive(Clone, Debug, Default, Args)]
pub struct TwoRuns {
    /// The two runs: their folders, their names below runs/, or the beginnings of either.
    #[arg(value_name = "RUN", num_args = 0..=2)]
    run: Vec<PathBuf>,
    /// The same as an option, given twice, or once for the second.
    #[arg(id = "run_option", long = "run", value_name = "RUN")]
    option: Vec<PathBuf>,
}

impl TwoRuns {
    /// As they were typed: those in their places first.
    ///
    /// # Errors
    /// There are not two.
    pub fn named(&self) -> Result<[&Path; 2], Failure> {
        let all: Vec<&Path> = self.run.iter().chain(&self.option).map(PathBuf::as_path).collect();
        <[&Path; 2]>::try_from(all).map_err(|all| {
            Failure::bad_input(format!(
                "expected two runs, found {}; name them as RUN RUN or by --run twice",
                all.len()
            ))
        })
    }
}

impl RunFolder {
    /// The folder that is named (see [`resolve`]), or the latest one below `runs`.
    pub fn find(named: Option<&Path>) -> Result<RunFolder, Failure> {
        let dir = match named {
            Some(name) => below_runs(name)?.dir,
            None => {
                let runs = Path::new(RUNS);
                let text = store::read_bounded(&runs.join(LATEST), CARD_BYTES_MAX)
                    .map_err(|_| Failure::bad_input("no run folder is named and there is no runs/LATEST; name one"))?;
                runs.join(String::from_utf8_lossy(&text).trim())
            }
        };
        let folder = RunFolder { dir };
        folder.card()?;
        Ok(folder)
    }
}

/// The folder that a name means: itself, one of that name below `runs`, or the one that begins so.
///
/// # Errors
/// There is none, or several begin so.
pub fn resolve(name: &Path, runs: &Path) -> Result<RunFolder, Failure> {
    if let Some(folder) = whole_in(name, runs) {
        return Ok(folder);
    }
    let mut begun: Vec<RunFolder> = Vec::new();
    for folders in [name, &runs.join(name)].map(beginning_with) {
        for folder in folders? {
            // From the folder runs/ itself a name may lead to one place in both ways.
            if begun.iter().all(|other| other.dir != folder.dir) {
                begun.push(folder);
            }
        }
    }
    // `own` is the run of the experiment `own`, although another one is called `own2`.
    let whole: Vec<usize> = (0..begun.len()).filter(|k| is_experiment(&begun[*k], name)).collect();
    if let [only] = whole[..] {
        return Ok(begun.swap_remove(only));
    }
    if begun.len() > 1 {
        let (count, names) = (begun.len(), listed(&begun));
        let name = name.display();
        return Err(Failure::bad_input(format!(
            "{count} runs begin with `{name}`: {names}; type more of the one you mean"
        )));
    }
    begun.pop().ok_or_else(|| unknown(name, runs))
}

/// Returns `true` if a run folder is one of the experiment of this name: the name, a dash and eight digits.
fn is_experiment(folder: &RunFolder, name: &Path) -> bool {
    let text = |path: &Path| path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let (folder, name) = (text(&folder.dir), text(name));
    folder.rsplit_once('-').is_some_and(|(experiment, id)| experiment == name && id.len() == 8)
}

/// The run folder that this is, or that has this name below runs/.
pub fn whole(name: &Path) -> Option<RunFolder> {
    whole_in(name, Path::new(RUNS))
}

fn whole_in(name: &Path, runs: &Path) -> Option<RunFolder> {
    let both = [name.to_path_buf(), runs.join(name)].map(|dir| RunFolder { dir });
    both.into_iter().find(RunFolder::has_card)
}

/// Run folders whose path begins so.
fn beginning_with(start: &Path) -> Result<Vec<RunFolder>, Failure> {
    let Some(first) = start.file_name().map(|name| name.to_string_lossy().into_owned()) else { return Ok(Vec::new()) };
    let parent = start.parent().filter(|dir| !dir.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let begins =
        |folder: &RunFolder| folder.dir.file_name().is_some_and(|name| name.to_string_lossy().starts_with(&first));
    let mut runs = runs_in(parent)?;
    runs.retain(begins);
    // `./x` is what was typed as `x`.
    if !start.starts_with(".") {
        runs.iter_mut()
            .for_each(|folder| folder.dir = folder.dir.strip_prefix(".").unwrap_or(&folder.dir).to_path_buf());
    }
    Ok(runs)
}

/// The run folders directly below a folder, by name.
fn runs_in(parent: &Path) -> Result<Vec<RunFolder>, Failure> {
    if !parent.is_dir() {
        return Ok(Vec::new());
    }
    let folders = store::list_dirs(parent)?.into_iter().map(|dir| RunFolder { dir });
    Ok(folders.filter(RunFolder::has_card).collect())
}

fn listed(folders: &[RunFolder]) -> String {
    let names: Vec<String> = folders.iter().take(LISTED_MAX).map(|of| of.dir.display().to_string()).collect();
    let more = folders.len().saturating_sub(LISTED_MAX);
    if more > 0 { format!("{} and {more} more", names.join(", ")) } else { names.join(", ") }
}

/// No run has this name; what there is instead.
fn unknown(name: &Path, runs: &Path) -> Failure {
    let all = runs_in(runs).unwrap_or_default();
    let known: Vec<String> =
        all.iter().filter_map(|of| of.dir.file_name()).map(|name| name.to_string_lossy().into_owned()).collect();
    let near = did_you_mean(&name.to_string_lossy(), &known);
    let there = match (name.is_absolute(), all.is_empty()) {
        // A whole path is no name: what else lies below runs/ was not looked for.
        (true, _) => String::new(),
        (false, true) => format!("; there is no run below {}", runs.display()),
        (false, false) => format!("; there are {}", listed(&all)),
    };
    let what = match (name.is_dir(), name.exists()) {
        (true, _) => "it has no run.json",
        (false, true) => "it is a file",
        (false, false) => "it does not exist",
    };
    let expected = "expected a run's folder, its name below runs/ or the beginning of either";
    Failure::bad_input(format!("{} is not a run folder: {what}; {expected}{there}{near}", name.display()))
}

/// Finds a run by its name below runs/.
pub fn below_runs(name: &Path) -> Result<RunFolder, Failure> {
    resolve(name, Path::new(RUNS))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folders(names: &[&str]) -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        for name in names {
            let folder = RunFolder { dir: dir.path().join("runs").join(name) };
            store::create_dir(&folder.dir).unwrap();
            folder.write_card(name, None).unwrap();
        }
        dir
    }

    fn found(dir: &Path, name: &str) -> Result<String, String> {
        let folder = resolve(Path::new(name), &dir.join("runs")).map_err(|failure| failure.message)?;
        Ok(folder.dir.file_name().unwrap().to_string_lossy().into_owned())
    }

    #[test]
    fn a_run_is_named_by_path_by_name_or_by_a_beginning_of_either() {
        let dir = folders(&["cat", "cat-12ab", "sage-77"]);
        let path = |name: &str| dir.path().join("runs").join(name).display().to_string();
        for name in ["sage-77", "sage", "s", &path("sage-77"), &path("sa")] {
            assert_eq!(found(dir.path(), name).unwrap(), "sage-77", "{name}");
        }
        // The whole name of one is meant, though another begins so.
        assert_eq!(found(dir.path(), "cat").unwrap(), "cat");
        assert_eq!(found(dir.path(), "cat-").unwrap(), "cat-12ab");
        // The name of one experiment is meant, though that of another begins so; two runs of it are not told apart.
        let dir = folders(&["own-12ab34cd", "own2-12ab34cd"]);
        assert_eq!(found(dir.path(), "own").unwrap(), "own-12ab34cd");
        assert!(found(folders(&["own-12ab34cd", "own-56ef78ab"]).path(), "own").is_err());
    }

    #[test]
    fn a_beginning_of_several_runs_is_refused_with_their_names() {
        let dir = folders(&["cat-1", "cat-2"]);
        let refused = found(dir.path(), "cat").unwrap_err();
        assert!(refused.starts_with("2 runs begin with `cat`: "), "{refused}");
        assert!(refused.contains("cat-1, ") && refused.contains("cat-2; type more"), "{refused}");
    }

    #[test]
    fn an_unknown_run_is_answered_with_what_there_is_and_the_nearest() {
        let dir = folders(&["quickstart-12", "sage-77"]);
        let refused = found(dir.path(), "quikstart-12").unwrap_err();
        assert!(refused.contains("does not exist") && refused.contains("sage-77"), "{refused}");
        assert!(refused.ends_with("did you mean `quickstart-12`?"), "{refused}");
        let empty = tempfile::tempdir().unwrap();
        let refused = found(empty.path(), "x").unwrap_err();
        assert!(refused.contains("there is no run below"), "{refused}");
    }

    #[test]
    fn a_folder_without_a_card_is_said_to_be_no_run() {
        let dir = tempfile::tempdir().unwrap();
        let refused = found(dir.path(), dir.path().to_str().unwrap()).unwrap_err();
        assert!(refused.contains("not a run folder"), "{refused}");
    }

    #[test]
    fn runs_in_their_places_come_before_those_of_options() {
        let paths = |names: &[&str]| names.iter().map(PathBuf::from).collect::<Vec<_>>();
        let two = TwoRuns { run: paths(&["a"]), option: paths(&["b"]) };
        assert_eq!(two.named().unwrap(), [Path::new("a"), Path::new("b")]);
        let one = TwoRuns { run: paths(&["a"]), option: vec![] };
        assert!(one.named().unwrap_err().message.starts_with("expected two runs, found 1"));
        let many = Runs { run: paths(&["a", "b"]), option: paths(&["c"]) };
        assert_eq!(many.named().collect::<Vec<_>>(), ["a", "b", "c"].map(Path::new));
    }
}
