//! Remedies in the words of the command line: the library names its own functions.

use greybox::text::renamed;

/// Functions of the library, and the options that do the same, with what they are given. Of names of which one begins with
/// the other, the longer one stands first.
const NAMES: &[(&str, &str)] = &[
    ("the bootstrap was cancelled; lower the flag to run it", "ended by Ctrl-C before twenty refits; run it again"),
    (
        "cancelled before its start had been evaluated; lower the flag to run it",
        "ended by Ctrl-C at once; run it again",
    ),
    ("cancelled; lower the flag to run it", "ended by Ctrl-C; run it again"),
    (", filter the restarts (Horizon::filtered), or take", ", or take"),
    (", or the `derivative` or `next` that Model::KIND asks for was not written", ""),
    (", or where the model takes its value(), and", ", and"),
    ("holds the time by DataFile::column", "holds the time by --time"),
    (
        "choose another integrator, Rk45 or, for a model with a fast mode, Esdirk",
        "choose another by --integrator: rk45 or, for a model with a fast mode, esdirk",
    ),
    ("tolerance of Esdirk", "tolerance of --integrator esdirk"),
    ("tolerance of Rk45", "tolerance of --integrator rk45"),
    ("take the predictor Kalman or SecondOrder", "take --predictor kalman or --predictor second-order"),
    ("take the predictor Kalman", "take --predictor kalman"),
    ("take Kalman, with", "take --predictor kalman, with"),
    ("use Kalman with", "use --predictor kalman with"),
    ("InitialCovariance::FirstInterval (kalman:first-interval)", "--predictor kalman:first-interval"),
    ("take Esdirk, or", "take --integrator esdirk, or"),
    ("(Horizon)", "(--predictor horizon:1)"),
    ("(Kalman)", "(--predictor kalman)"),
    ("FreeRun", "--predictor simulation"),
    ("SecondOrder", "--predictor second-order"),
    (".within(0.0, ..)", "--bounds"),
    ("free(..).log()", "--log"),
    (".log()", "--log"),
    (".per_experiment()", "--per-record"),
    (".positive()", "--positive"),
    (
        "DataFile::delimiter, or DataFile::decimal_comma where numbers are written as 1,5",
        "a comma, semicolon or tab, and no comma where numbers are written as 1,5",
    ),
    ("for decimal commas there is DataFile::decimal_comma", "decimal commas need a semicolon or tab between cells"),
    ("is skipped by DataFile::units_row", "belongs right below the names"),
    ("DataFile::offset", "an offset"),
    ("DataFile::reversed turns a sign", "turn a sign in the model"),
    ("DataFile::reversed", "a turned sign"),
    ("DataFile::factor(\"t\", ..)", "--time-unit"),
    ("DataFile::factor of `t`", "--time-unit"),
    ("DataFile::column", "--column {}"),
    ("DataFile::dates", "--date-order"),
    ("DataFile::factor", "--unit {}"),
    ("DataFile::fill, Record::from_series", "--fill"),
    ("DataFile::fill", "--fill {}"),
    ("DataFile::sample_time", "--sample-time {}"),
    ("DataFile::unit", "--unit {}"),
    ("DataFile::zone", "--zone {}"),
    ("Experiment::between", "--between {}"),
    ("Experiment::initial", "--initial {}"),
    ("Experiment::slice", "--between {}"),
    ("Experiment::without_gaps", "--between"),
    ("Fit::integrator", "--integrator {}"),
    ("Fit::noise_covariance", "--noise-covariance"),
    ("Fit::staged", "--staged"),
    ("Fit::starts", "--starts {}"),
    ("Fit::weighting", "--weight {}"),
    ("Model::diffusion", "`diffusion`"),
    ("Model::initial_noise", "`initial_noise`"),
    ("Model::noise", "`noise`"),
    ("Parameter::per_experiment", "--per-record"),
    ("Record::decimate", "--every {}"),
    ("diagnose::profile", "`greybox profile`"),
    ("initial_from_first_sample", "--initial first"),
];

/// A text of the library with the options of the command in place of its functions.
pub fn in_shell(text: &str) -> String {
    // Markdown has underscores escaped.
    let escaped = |text: &str| text.replace('_', "\\_");
    let markdown = NAMES.iter().filter(|(theirs, _)| theirs.contains('_'));
    let markdown: Vec<(String, String)> = markdown.map(|(theirs, ours)| (escaped(theirs), escaped(ours))).collect();
    let markdown: Vec<(&str, &str)> = markdown.iter().map(|(theirs, ours)| (theirs.as_str(), ours.as_str())).collect();
    renamed(&renamed(text, NAMES), &markdown)
}

#[cfg(test)]
#[path = "../../python/src/remedies.rs"]
mod python;

#[cfg(test)]
mod tests {
    use super::{in_shell, python::in_python};
    use crate::arguments::Arguments;
    use clap::CommandFactory;
    use std::path::Path;

    /// What a program in Rust alone can meet: its own models and predictors, and what it calls by itself.
    const OF_PROGRAMS: [&str; 5] = [
        "Predictor::needs_slopes",
        "Table::surface",
        "Constant::FluxLinkage",
        "Extrapolation::Linear",
        "Stepping::Split",
    ];

    #[test]
    fn remedies_are_options() {
        for (theirs, ours) in [
            ("give DataFile::factor(\"w\", 0.1047), or 1 if", "give --unit w=0.1047, or 1 if"),
            ("seconds one is by DataFile::factor(\"t\", ..)", "seconds one is by --time-unit"),
            ("looks for it: Fit::starts(32)", "looks for it: --starts 32"),
            ("an end (Fit::starts), which; Fit::staged", "an end (--starts), which; --staged"),
            ("by DataFile::zone (\"Europe/Berlin\")", "by --zone (\"Europe/Berlin\")"),
            ("its rate (DataFile::fill, Record::from_series)", "its rate (--fill)"),
            ("covariance (Fit::noise\\_covariance) weighs", "covariance (--noise-covariance) weighs"),
            ("of units is skipped by DataFile::units_row, and", "of units belongs right below the names, and"),
            (", or where the model takes its value(), and the search", ", and the search"),
            ("say which one holds the time by DataFile::column, or", "say which one holds the time by --time, or"),
            ("DataFile::sample_time of 0.1 s and", "--sample-time of 0.1 s and"),
            ("nothing of the library", "nothing of the library"),
        ] {
            assert_eq!(in_shell(theirs), ours);
        }
    }

    #[test]
    fn both_doors_know_all_names_in_sentences_of_the_library() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let command = Arguments::command();
        let is_option = |word: &str| {
            let mut options = command.get_subcommands().flat_map(clap::Command::get_arguments);
            options.any(|option| option.get_long() == Some(word))
        };
        // These have arguments that are words of a sentence there.
        let errors = std::fs::read_to_string(root.join("python/greybox/errors.py")).unwrap();
        let by_errors = ["DataFile::factor", "DataFile::unit"].map(|name| errors.contains(name).then_some(name));
        let mut sentences = vec![];
        collect(&root.join("src"), &mut sentences);
        let mut named = 0;
        for text in &sentences {
            named += names(text).len();
            let (shell, python) = (in_shell(text), in_python(text));
            let left = names(&shell);
            assert!(left.iter().all(|name| OF_PROGRAMS.contains(&name.as_str())), "the shell: {left:?} in {text}");
            let left = names(&python).into_iter();
            let left: Vec<String> = left.filter(|name| !by_errors.contains(&Some(name.as_str()))).collect();
            assert!(left.iter().all(|name| OF_PROGRAMS.contains(&name.as_str())), "Python: {left:?} in {text}");
            for (at, _) in shell.match_indices("--").filter(|_| shell != *text) {
                let end = |letter: char| !letter.is_alphanumeric() && letter != '-' && letter != '_';
                let word = shell[at + 2..].split(end).next().unwrap_or_default();
                assert!(is_option(word), "there is no option --{word}: {shell}");
            }
        }
        // Those of now; fewer would say that literals are not found any more.
        assert!(named > 60, "{named}");
    }

    /// Names of Rust in a sentence: paths, and methods.
    fn names(text: &str) -> Vec<String> {
        let of_name = |letter: char| letter.is_alphanumeric() || letter == '_' || letter == ':';
        let words = text.split(|letter| !of_name(letter)).map(|word| word.trim_matches(':'));
        let is_path = |word: &&str| {
            let before = word.split_once("::").map(|(before, _)| before);
            let is_type = |name: &str| name.starts_with(|letter: char| letter.is_uppercase());
            before.is_some_and(|name| is_type(name) || name == "diagnose" || name == "units")
                || ["FreeRun", "SecondOrder", "initial_from_first_sample"].contains(word)
        };
        let methods = [".log()", ".positive()", ".per_experiment()", ".within(0.0"];
        let paths = words.filter(is_path).map(|word| word.trim_start_matches("units::").to_owned());
        paths.chain(methods.into_iter().filter(|name| text.contains(name)).map(str::to_owned)).collect()
    }

    /// The literals of the library's code, but for tests and for the writers of code.
    fn collect(folder: &Path, sentences: &mut Vec<String>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let writes_code = folder.ends_with("text") && ["rust", "latex"].contains(&name.as_str());
            if writes_code || name == "tests" || name == "guide" {
                continue;
            }
            if path.is_dir() {
                collect(&path, sentences);
                continue;
            }
            let text = std::fs::read_to_string(&path).unwrap();
            let code = text.split("#[cfg(test)]").next().unwrap_or_default().replace("'\"'", "");
            let is_text = |line: &&str| {
                let line = line.trim_start();
                !line.starts_with(['/', '#']) || line.starts_with("#[error(")
            };
            let lines = code.lines().filter(is_text);
            literals(&lines.collect::<Vec<_>>().join("\n"), sentences);
        }
    }

    /// The texts between quotation marks, as they are when the program runs.
    fn literals(code: &str, found: &mut Vec<String>) {
        let mut letters = code.chars();
        let mut open: Option<String> = None;
        while let Some(letter) = letters.next() {
            match (&mut open, letter) {
                (Some(_), '"') => found.extend(open.take()),
                (None, '"') => open = Some(String::new()),
                (Some(text), '\\') => match letters.next() {
                    Some('\n') => {
                        let rest = letters.as_str().trim_start();
                        letters = rest.chars();
                    }
                    Some(escaped) => text.push(escaped),
                    None => {}
                },
                (Some(text), letter) => text.push(letter),
                (None, _) => {}
            }
        }
    }
}
