//! The command as a shell sees it: what it prints, what it leaves behind, and its exit codes.

mod bench;
mod derived;
mod files;
mod fleet;
mod project;
mod remarks;

use bench::{Bench, MODEL, record, value};
use std::path::Path;
use std::process::Output;

#[test]
fn fit_prints_the_estimate_and_writes_what_is_asked_for() {
    let bench = Bench::new();
    let words = ["fit", "pmsm.toml", "record.csv", "--json", "e.json", "--report", "r.html", "--plot", "fit.svg"];
    let (out, error) = bench.ends(0, &words);
    // The truth is 0.63, 4e-3 and 0.95; standard errors are 2e-4, 1.4e-6 and 2.5e-5.
    assert!((value(&out, "rs") - 0.63).abs() < 1e-3 && (value(&out, "ke") - 0.95).abs() < 1e-4, "{out}");
    assert!(out.starts_with("Verdict: usable"), "{out}");
    assert!(out.lines().all(|line| line.chars().count() <= 80), "{out}");
    assert!(!out.contains('\u{1b}') && !error.contains('\u{1b}'), "color and progress are for terminals");
    assert!(error.contains("record.csv: "), "what was guessed of the file: {error}");
    let text = |name: &str| std::fs::read_to_string(bench.path(name)).unwrap();
    let page = text("r.html");
    assert!(page.contains("PMSM") && text("fit.svg").starts_with("<svg"));
    // The first section has the equations as the model file has them.
    let first = page.split("<section").nth(1).unwrap();
    assert!(first.contains("Equations") && first.contains("(ud - rs*id)/ls + we*iq"), "{first}");
    let estimate = greybox::Summary::from_json(&text("e.json")).unwrap();
    assert_eq!(estimate.parameters[2].name, "ke");
    assert_eq!(bench.names(), ["e.json", "fit.svg", "pmsm.toml", "r.html", "record.csv"], "nothing half-written");
    let (_, error) = bench.ends(0, &["fit", "-q", "pmsm.toml", "record.csv"]);
    assert_eq!(error, "");
}

/// A voltage that changes between two samples of three is said to be lost with them, not one that is held for many.
#[test]
fn thinning_says_what_inputs_lose() {
    let bench = Bench::new();
    let text = std::fs::read_to_string(bench.path("record.csv")).unwrap();
    let moved = |(k, line): (usize, &str)| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if k > 0 {
            cells[2] = (cells[2].parse::<f64>().unwrap() + 100.0 * f64::from(k as u32 % 2)).to_string();
        }
        cells.join(",") + "\n"
    };
    std::fs::write(bench.path("moving.csv"), text.lines().enumerate().map(moved).collect::<String>()).unwrap();
    let of =
        |n: &str| String::from_utf8(bench.run(&["check", "pmsm.toml", "moving.csv", "--every", n]).stderr).unwrap();
    let (one, three) = (of("1"), of("3"));
    assert!(!one.contains("--every") && three.contains("--every 3: inputs change"), "{one} {three}");
    assert!(three.contains("`uq` ") && !three.contains("`w` "), "{three}");
}

/// No result takes the place of what the command reads, nor of another result, also by another path to the same file.
#[test]
fn results_take_no_place_of_what_is_read() {
    let bench = Bench::new();
    bench.ends(0, &["fit", "pmsm.toml", "record.csv", "--json", "e.json"]);
    let kept = ["pmsm.toml", "record.csv", "e.json"].map(|name| std::fs::read(bench.path(name)).unwrap());
    let fit = ["fit", "pmsm.toml", "record.csv"];
    let values = ["--set", "rs=1", "--set", "ls=1e-3", "--set", "ke=1"];
    let cases: [(&[&str], &[&str]); 8] = [
        (&fit, &["--json", "pmsm.toml"]),
        (&fit, &["--json", "./record.csv"]),
        (&fit, &["--json", "new.json", "--report", "new.json"]),
        (&["convert", "pmsm.toml", "record.csv"], &["--every", "10", "-o", "record.csv"]),
        (&["simulate", "pmsm.toml", "record.csv", "-o", "record.csv"], &values),
        (&["export", "pmsm.toml"], &["-o", "pmsm.toml"]),
        (&["residuals", "pmsm.toml", "record.csv", "--estimate", "e.json"], &["--report", "e.json"]),
        (&["compare", "--model", "pmsm.toml:e.json", "record.csv"], &["--report", "e.json"]),
    ];
    for (words, more) in cases {
        let words = [words, more].concat();
        let (_, error) = bench.ends(1, &words);
        assert!(
            error.contains("this command reads it") || error.contains("two results would go there"),
            "{words:?} {error}"
        );
    }
    assert_eq!(["pmsm.toml", "record.csv", "e.json"].map(|name| std::fs::read(bench.path(name)).unwrap()), kept);
    assert_eq!(bench.names(), ["e.json", "pmsm.toml", "record.csv"]);
}

/// But for what depends on the processor and its load: the search's last step, its iterations and its time.
#[test]
fn the_readme_shows_what_is_printed() {
    let readme = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../README.md")).unwrap();
    let shown = readme.split("```").find(|block| block.starts_with("text\nVerdict")).unwrap();
    let (out, _) = Bench::new().ends(0, &["fit", "pmsm", "record.csv", "--constant", "np=4"]);
    let fixed = |text: &str| -> Vec<String> {
        let lines = text.lines().skip_while(|line| !line.starts_with("parameter"));
        lines.filter(|line| !line.contains(" iterations, ")).map(str::to_string).collect()
    };
    assert_eq!(fixed(shown), fixed(&out));
    assert!(fixed(shown).len() > 10 && out.starts_with("Verdict: usable. Search: converged"), "{out}");
}

#[test]
fn declarations_are_changed_by_name() {
    let bench = Bench::new();
    let (out, _) = bench.ends(0, &["fit", "pmsm.toml", "record.csv", "--fix", "ls=4e-3", "--set", "rs=0.5"]);
    assert!(out.contains("fixed") && (value(&out, "rs") - 0.63).abs() < 1e-3, "{out}");
    let (out, _) = bench.ends(0, &["fit", "pmsm.toml", "record.csv", "--derived", "tau=ls/rs", "--loss", "huber"]);
    assert!(out.contains("tau = 0.00634") && out.contains("loss Huber"), "{out}");
    // Errors of predictions 20 samples ahead are correlated, which asks for care.
    let (out, _) =
        bench.ends(2, &["fit", "pmsm.toml", "record.csv", "--weight", "abs(w)", "--predictor", "horizon:20"]);
    assert!(out.contains("20 sample(s) ahead"), "{out}");
    // Two pole pairs instead of four: the model explains the record no more.
    let (out, _) = bench.ends(3, &["fit", "pmsm.toml", "record.csv", "--constant", "np=2"]);
    assert!(out.starts_with("Verdict: not usable"), "{out}");
}

/// What is said of one output leaves that of the others as the model file has it.
#[test]
fn noise_is_changed_by_name() {
    let bench = Bench::new();
    let text = MODEL.replace(
        "id = \"id\"\niq = \"iq\"",
        "id = { value = \"id\", noise = 0.05 }\niq = { value = \"iq\", noise = 2.0 }",
    );
    std::fs::write(bench.path("noisy.toml"), text).unwrap();
    let fit = |noise: &[&str]| {
        let words = [&["fit", "noisy.toml", "record.csv"], noise].concat();
        let out = String::from_utf8(bench.run(&words).stdout).unwrap();
        ["rs", "ls", "ke"].map(|name| value(&out, name))
    };
    let [one, both] = [fit(&["--noise", "id=1"]), fit(&["--noise", "id=1", "--noise", "iq=2"])];
    assert_eq!(one, both);
    assert_ne!(one, fit(&["--noise", "id=1", "--noise", "iq=0.05"]));
}

#[test]
fn exit_codes_tell_how_far_an_estimate_is_usable() {
    let bench = Bench::new();
    // A bound that holds a parameter asks for care.
    let held = ["fit", "pmsm.toml", "record.csv", "--set", "ke=1", "--bounds", "ke=0.96..2"];
    let (out, _) = bench.ends(bench.run(&held).status.code().unwrap(), &held);
    assert!(out.starts_with("Verdict: usable with care"), "{out}");
    assert_ne!(bench.run(&held).status.code(), Some(0));
    let strict: Vec<&str> = held.iter().copied().chain(["--strict"]).collect();
    bench.ends(3, &strict);
}

#[test]
fn mistakes_are_sentences_with_the_remedy() {
    let bench = Bench::new();
    let says = |words: &[&str], parts: &[&str]| {
        let (_, error) = bench.ends(1, words);
        parts.iter().for_each(|part| assert!(error.contains(part), "{part} in\n{error}"));
    };
    says(&["fit", "motor.toml", "record.csv"], &["no file `motor.toml`", "ship"]);
    says(&["fit", "pmsm.toml", "other.csv"], &["other.csv"]);
    says(&["fit", "pmsm.toml"], &["no record is named"]);
    says(&["fit", "pmsm.toml", "record.csv", "--set", "rss=1"], &["no parameter `rss` (`rs` is near)", "rs, ls, ke"]);
    says(&["fit", "pmsm.toml", "record.csv", "--set", "rs=one"], &["--set rs", "`one` is not a number"]);
    says(&["fit", "pmsm.toml", "record.csv", "--loss", "hubber"], &["no loss `hubber` (`huber` is near)"]);
    says(&["fit", "pmsm.toml", "record.csv", "--column", "w=speed"], &["no column `speed`", "ud"]);
    says(&["fit", "pmsm.toml", "record.csv", "--weight", "abs(v)"], &["v"]);
    says(&["fit", "pmsm.toml", "record.csv", "--report", "r.pdf"], &[".html, .md, .json or .txt"]);
    says(&["fit", "pmsm.toml", "record.csv", "--json", "nowhere/e.json"], &["nowhere/e.json"]);
    says(&["fit", "pmsm.toml", "record.csv", "--no-such"], &["--no-such"]);
    says(&["fit", "pmsm.toml", "record.csv", "--bounds", "rs=1"], &["two points"]);
    assert_eq!(bench.names(), ["pmsm.toml", "record.csv"]);
}

#[test]
fn a_mistake_in_a_model_file_is_shown_with_its_place() {
    let bench = Bench::new();
    std::fs::write(bench.path("wrong.toml"), MODEL.replace("(ud - rs*id)", "(ud - r*id)")).unwrap();
    let (_, error) = bench.ends(1, &["fit", "-q", "wrong.toml", "record.csv"]);
    assert!(error.starts_with("error: nothing is called `r`\n  --> wrong.toml:17:40\n"), "{error}");
}

#[test]
fn a_project_file_repeats_a_fit() {
    let bench = Bench::new();
    let project = "model = 'pmsm.toml'\nrecords = ['record.csv']\nfix = { ls = 4e-3 }\nbounds = { rs = [0.01, 5] }\nloss = 'huber'\n";
    std::fs::write(bench.path("greybox.toml"), project).unwrap();
    let (out, _) = bench.ends(0, &["fit"]);
    assert!(out.contains("loss Huber") && out.contains("fixed"), "{out}");
    // The command line comes after it.
    let (out, _) = bench.ends(0, &["fit", "--loss", "squared"]);
    assert!(out.contains("loss squared"), "{out}");
    std::fs::write(bench.path("greybox.toml"), "model = 'pmsm.toml'\nlos = 'huber'\n").unwrap();
    let (_, error) = bench.ends(1, &["fit"]);
    assert!(error.contains("greybox.toml: there is no option `los`"), "{error}");
}

/// Options mean what they mean in `fit` and `fleet`; a comparison takes those of its fits; help is none of its words.
#[test]
fn a_project_file_is_for_fits() {
    let bench = Bench::new();
    let project = "model = 'pmsm.toml'\nrecords = ['record.csv']\nnoise = { id = 0.05, iq = 0.05 }\nout = 'motors.csv'\nloss = 'huber'\n";
    std::fs::write(bench.path("greybox.toml"), project).unwrap();
    let (out, _) = bench.ends(0, &["export", "pmsm.toml", "--language", "latex"]);
    assert!(out.contains('\\') && !bench.path("motors.csv").exists(), "{out}");
    let words = ["simulate", "pmsm.toml", "record.csv", "--fix", "rs=0.63", "--fix", "ls=4e-3", "--fix", "ke=0.95"];
    let (with, _) = bench.ends(0, &words);
    let (help, _) = bench.ends(0, &["help", "fit"]);
    assert!(help.contains("--loss"), "{help}");
    let compared = ["compare", "--model", "pmsm.toml", "record.csv", "--report", "c.html"];
    bench.ends(0, &compared);
    assert!(std::fs::read_to_string(bench.path("c.html")).unwrap().contains("Huber"));
    std::fs::remove_file(bench.path("greybox.toml")).unwrap();
    let (without, _) = bench.ends(0, &words);
    assert!(with == without && with.lines().count() == 2001, "{}", with.lines().count());
}

/// Before the work, not after it.
#[test]
fn files_that_cannot_be_written_are_named_at_once() {
    let bench = Bench::new();
    for (option, path, says) in [
        ("--json", "nowhere/e.json", "no such folder"),
        ("--report", "r.pdf", "take .html, .md, .json or .txt"),
        ("--plot", "p.jpg", "take .svg"),
    ] {
        let (out, error) = bench.ends(1, &["fit", "pmsm.toml", "record.csv", option, path]);
        assert!(out.is_empty() && error.contains(path) && error.contains(says), "{out} {error}");
    }
    for command in ["residuals", "profile", "bootstrap", "compare"] {
        let model: &[&str] = if command == "compare" { &["--model", "pmsm.toml"] } else { &["pmsm.toml"] };
        let words = [&[command], model, &["record.csv", "--report", "nowhere/r.html"]].concat();
        let (out, error) = bench.ends(1, &words);
        // A record that is read says what was guessed of it.
        assert!(out.is_empty() && error.starts_with("error: nowhere/r.html: there is no such folder"), "{error}");
    }
    for command in ["simulate", "convert"] {
        for (file, ending) in [("made.txt", ".txt"), ("made.json", ".json")] {
            let (_, error) = bench.ends(1, &[command, "pmsm.toml", "record.csv", "--out", file]);
            let says = format!("error: {file}: files that end in {ending} are not written; take .csv");
            assert!(error.starts_with(&says), "{error}");
        }
    }
}

/// A link stays one.
#[cfg(unix)]
#[test]
fn what_a_link_leads_to_is_written() {
    let bench = Bench::new();
    for (link, file) in [("e.json", "estimate"), ("r.html", "report"), ("p.svg", "plot"), ("t.csv", "table")] {
        std::fs::write(bench.path(file), "").unwrap();
        std::os::unix::fs::symlink(bench.path(file), bench.path(link)).unwrap();
    }
    let words = ["fit", "pmsm.toml", "record.csv", "--json", "e.json", "--report", "r.html", "--plot", "p.svg"];
    bench.ends(0, &words);
    bench.ends(0, &["convert", "pmsm.toml", "record.csv", "--out", "t.csv"]);
    for (link, file, begin) in
        [("e.json", "estimate", "{"), ("r.html", "report", "<!"), ("p.svg", "plot", "<svg"), ("t.csv", "table", "t,")]
    {
        assert!(bench.path(link).is_symlink(), "{link}");
        let text = std::fs::read_to_string(bench.path(file)).unwrap();
        assert!(text.starts_with(begin), "{file}: {}", text.lines().next().unwrap_or_default());
    }
    assert!(!bench.names().iter().any(|name| name.ends_with(".part")), "{:?}", bench.names());
}

#[test]
fn a_simulation_is_a_record_that_gives_its_parameters_back() {
    let bench = Bench::new();
    let truth = ["--fix", "rs=0.63", "--fix", "ls=4e-3", "--fix", "ke=0.95"];
    let words: Vec<&str> =
        ["simulate", "pmsm.toml", "record.csv", "--noise", "id=0.05", "--noise", "iq=0.05", "-o", "made.csv"]
            .into_iter()
            .chain(truth)
            .collect();
    bench.ends(0, &words);
    let (out, _) = bench.ends(0, &["fit", "pmsm.toml", "made.csv", "--json", "e.json"]);
    assert!((value(&out, "rs") - 0.63).abs() < 1e-3, "{out}");
    let (out, _) = bench.ends(0, &["simulate", "pmsm.toml", "record.csv", "--estimate", "e.json"]);
    assert!(out.starts_with("t,ud,uq,w,id,iq\n") && out.lines().count() == 2001, "{}", out.lines().count());
}

#[test]
fn models_new_check_and_export_work_together() {
    let bench = Bench::new();
    bench.ends(0, &["new", "tank.toml"]);
    let (_, error) = bench.ends(1, &["new", "tank.toml"]);
    assert!(error.contains("there already"), "{error}");
    let (out, _) = bench.ends(0, &["check", "tank.toml"]);
    assert!(out.contains("Draining tank") && out.contains("area (m^2)"), "{out}");
    let (out, _) = bench.ends(0, &["models"]);
    assert!(out.lines().any(|line| line.starts_with("pmsm ")), "{out}");
    let (text, _) = bench.ends(0, &["models", "pmsm"]);
    std::fs::write(bench.path("copy.toml"), text).unwrap();
    let (own, _) = bench.ends(0, &["fit", "-q", "copy.toml", "record.csv"]);
    let (shipped, _) = bench.ends(0, &["fit", "-q", "pmsm", "record.csv", "--constant", "np=4"]);
    assert_eq!(value(&own, "rs"), value(&shipped, "rs"));
    let (out, _) = bench.ends(0, &["check", "pmsm.toml", "record.csv"]);
    assert!(out.contains("2000 samples") && out.contains("told apart"), "{out}");
    for (language, part) in [("toml", "[parameters]"), ("rust", "impl Model for"), ("json", "layout")] {
        let (out, _) = bench.ends(0, &["export", "pmsm.toml", "--language", language]);
        assert!(out.contains(part), "{language}: {out}");
    }
}

#[test]
fn estimates_are_examined_and_compared() {
    let bench = Bench::new();
    bench.ends(0, &["fit", "pmsm.toml", "record.csv", "--json", "e.json"]);
    let (out, _) = bench.ends(0, &["profile", "pmsm.toml", "record.csv", "--estimate", "e.json", "--of", "rs"]);
    assert!(out.contains("rs") && out.contains("95 %"), "{out}");
    let (out, _) = bench.ends(0, &["residuals", "pmsm.toml", "record.csv", "--estimate", "e.json"]);
    assert!(out.contains("esiduals"), "{out}");
    let (out, _) = bench.ends(0, &["bootstrap", "pmsm.toml", "record.csv", "--estimate", "e.json", "--refits", "20"]);
    assert!(out.contains("20"), "{out}");
    let renamed = MODEL.replace("rs = {", "resistance = {").replace("rs*", "resistance*");
    std::fs::write(bench.path("renamed.toml"), renamed).unwrap();
    let (_, error) = bench.ends(1, &["compare", "--model", "renamed.toml:e.json", "record.csv"]);
    assert!(error.contains("of a model with other parameters"), "{error}");
    std::fs::write(bench.path("wrong.toml"), MODEL.replace("we*iq", "0.5*we*iq")).unwrap();
    let words = ["compare", "--model", "pmsm.toml:e.json", "--model", "wrong.toml", "record.csv", "--report", "c.html"];
    let (out, _) = bench.ends(0, &words);
    assert!(out.contains("pmsm.toml") && out.contains("wrong.toml"), "{out}");
    assert!(std::fs::read_to_string(bench.path("c.html")).unwrap().contains("wrong.toml"));
    // Each has its verdict.
    let line = |name: &str| out.lines().rfind(|line| line.starts_with(name)).unwrap().to_owned();
    assert!(line("pmsm.toml").contains(" usable ") && line("wrong.toml").contains("not usable"), "{out}");
    // An estimate of a model that has changed since, or of another record, says nothing of these.
    for words in [["wrong.toml", "record.csv"], ["pmsm.toml", "part.csv"]] {
        let text = std::fs::read_to_string(bench.path("record.csv")).unwrap();
        let reversed = text.lines().map(|line| line.replace("-", "")).collect::<Vec<_>>().join("\n") + "\n";
        std::fs::write(bench.path("part.csv"), reversed).unwrap();
        for command in ["residuals", "profile", "bootstrap"] {
            let (_, error) = bench.ends(1, &[&[command], &words[..], &["--estimate", "e.json"]].concat());
            assert!(error.contains("e.json: with this model"), "{error}");
        }
        let compared = bench.run(&["compare", "--model", &format!("{}:e.json", words[0]), words[1]]);
        let out = String::from_utf8(compared.stdout).unwrap().replace('\n', " ");
        assert!(out.contains("is of other records, or of a model that has changed since"), "{out}");
    }
}

#[test]
fn shells_and_manuals_know_the_command() {
    let bench = Bench::new();
    let (out, _) = bench.ends(0, &["completions", "bash"]);
    assert!(out.contains("--time-limit"), "{out}");
    let (out, _) = bench.ends(0, &["man"]);
    assert!(out.contains(".TH greybox"), "{out}");
    let (out, _) = bench.ends(0, &["help"]);
    assert!(out.contains("Exit codes: 0 usable, 2 usable with care, 3 not usable, 1 error"), "{out}");
    bench.ends(1, &["fitt"]);
}

/// Dates that have no zone, and could have the month first.
#[test]
fn dates_are_read_with_an_order_and_a_zone() {
    let bench = Bench::new();
    let text = std::fs::read_to_string(bench.path("record.csv")).unwrap();
    let row = |(k, line): (usize, &str)| {
        format!("05/10/2025 02:{:02}:{:02},{}\n", k / 60, k % 60, line.split_once(',').unwrap().1)
    };
    let rows: String = text.lines().skip(1).take(1000).enumerate().map(row).collect();
    std::fs::write(bench.path("dates.csv"), format!("t,ud,uq,w,id,iq\n{rows}")).unwrap();
    let check = |words: &[&str]| {
        let words: Vec<&str> = ["check", "pmsm.toml", "dates.csv"].iter().chain(words).copied().collect();
        let Output { stderr, .. } = bench.run(&words);
        String::from_utf8(stderr).unwrap()
    };
    let error = check(&["--date-order", "day", "--zone", "Europe/Berlin"]);
    assert!(error.contains("dates, day first, in Europe/Berlin, from 05/10/2025 02:00:00"), "{error}");
    let error = check(&["--date-order", "month"]);
    assert!(error.contains("dates, month first, from"), "{error}");
    let error = check(&["--zone", "Europe/Berlim"]);
    assert!(error.contains("Europe/Berlim"), "{error}");
    let error = check(&["--date-order", "year"]);
    assert!(error.contains("day, month"), "{error}");
}

/// The speed is sampled at every tenth row only; it changes by 90 rad/s each second, 0.2 rad/s between its samples.
#[test]
fn an_input_with_a_rate_of_its_own_is_filled_in() {
    let bench = Bench::new();
    let text = std::fs::read_to_string(bench.path("record.csv")).unwrap();
    let sparse = |(k, line): (usize, &str)| {
        let mut cells: Vec<&str> = line.split(',').collect();
        if k % 10 != 1 && k > 0 {
            cells[3] = "";
        }
        cells.join(",") + "\n"
    };
    std::fs::write(bench.path("sparse.csv"), text.lines().enumerate().map(sparse).collect::<String>()).unwrap();
    let (_, error) = bench.ends(1, &["fit", "pmsm.toml", "sparse.csv"]);
    assert!(error.contains("`w` is NaN") && error.contains("a rate of its own (--fill)"), "{error}");
    let words = ["fit", "pmsm.toml", "sparse.csv", "--fill", "w", "--hold", "w=first"];
    let output = bench.run(&words);
    let [out, error] = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text).into_owned());
    assert!(error.contains("`w` filled in between 200 samples; 9 rows left out"), "{error}");
    // Where the speed bends between its samples it is not quite right: the standard error of the resistance is 4e-3.
    assert!((value(&out, "rs") - 0.63).abs() < 0.012 && (value(&out, "ke") - 0.95).abs() < 2e-3, "{out}");
    let (_, error) = bench.ends(1, &["fit", "pmsm.toml", "sparse.csv", "--fill", "v"]);
    assert!(error.contains("`v`") && error.contains("ud, uq, w"), "{error}");
}

#[test]
fn remedies_are_options() {
    let bench = Bench::new();
    let text = std::fs::read_to_string(bench.path("record.csv")).unwrap();
    std::fs::write(bench.path("rpm.csv"), text.replacen(",w,", ",w [rpm],", 1)).unwrap();
    let (_, error) = bench.ends(1, &["fit", "pmsm.toml", "rpm.csv"]);
    assert!(error.contains("give --unit w=0.10471975511965977, or 1") && !error.contains("DataFile"), "{error}");
}

/// With the digits that the standard error leaves, however small or large.
#[test]
fn derived_quantities_have_significant_digits() {
    let bench = Bench::new();
    let words = ["fit", "pmsm.toml", "record.csv", "--derived", "small=ls*1e-6", "--derived", "large=rs*1e9"];
    let (out, _) = bench.ends(0, &words);
    let line = |name: &str| out.lines().find(|line| line.starts_with(&format!("{name} = "))).unwrap();
    for (name, truth, expected) in [("small", 4e-9, 1e-11), ("large", 0.63e9, 1e6)] {
        let numbers =
            line(name).split(['=', ',', '…']).flat_map(|part| part.split(' ')).filter_map(|word| word.parse().ok());
        let numbers: Vec<f64> = numbers.filter(|number| *number != 95.0).collect();
        let [value, error, lower, upper] = numbers[..] else { panic!("{}", line(name)) };
        assert!((value - truth).abs() < expected && error > 0.0 && lower < value && value < upper, "{}", line(name));
        assert!(line(name).chars().count() < 80, "{}", line(name));
    }
}

#[test]
fn patterns_are_expanded_wherever_records_are_named() {
    let bench = Bench::new();
    std::fs::copy(record(), bench.path("other.csv")).unwrap();
    let (out, _) = bench.ends(0, &["compare", "--model", "pmsm.toml", "rec*.csv", "--validation", "oth*.csv"]);
    assert!(out.contains("other"), "{out}");
    bench.ends(0, &["convert", "pmsm.toml", "rec*.csv", "--out", "made.csv"]);
    let (_, error) = bench.ends(1, &["convert", "pmsm.toml", "*.csv"]);
    assert!(error.contains("name one record, after the model; 3 are named"), "{error}");
}

/// What would have no effect, or contradicts another option.
#[test]
fn options_without_a_meaning_are_refused() {
    let bench = Bench::new();
    let simulate = |option: &str, value: &str| {
        let fixed = ["--fix", "rs=0.63", "--fix", "ls=4e-3", "--fix", "ke=0.95"];
        let (out, error) =
            bench.ends(1, &[&["simulate", "pmsm.toml", "record.csv", option, value], &fixed[..]].concat());
        assert!(out.is_empty() && error.contains(option), "{error}");
        error
    };
    for (option, value) in [
        ("--bounds", "rs=0..1"),
        ("--prior", "rs=1,1"),
        ("--log", "rs"),
        ("--positive", "rs"),
        ("--free", "rs"),
        ("--per-record", "rs"),
    ] {
        let error = simulate(option, value);
        assert!(error.contains("it has no meaning here; it is an option of fit, compare, "), "{error}");
    }
    for (option, value) in [("--noise", &["id=1"][..]), ("--noise-covariance", &[])] {
        let words = [&["fit", "pmsm.toml", "record.csv", "--predictor", "kalman", option], value].concat();
        let (_, error) = bench.ends(1, &words);
        let says = format!("{} has no effect on the predictor kalman, a filter", [&[option], value].concat().join(" "));
        assert!(error.contains(&says), "{error}");
    }
    let (_, error) = bench.ends(1, &["fleet", "pmsm.toml", "record.csv", "--per-record", "rs"]);
    assert!(error.contains("--per-record rs: each record of a fleet is fitted by itself"), "{error}");
    let (help, _) = bench.ends(0, &["fleet", "--help"]);
    assert!(!help.contains("--per-record") && !help.contains("--checkpoint") && help.contains("--prior"), "{help}");
    assert!(simulate("--noise", "id=-1").contains("-1 is no standard deviation; give a positive number, or 0"));
    let timed = |option: &str, value: &str| {
        let words = ["check", "pmsm.toml", "record.csv", "--sample-time", "5e-4", option, value];
        bench.ends(1, &words).1
    };
    for (option, value) in [
        ("--time <COLUMN>", "t"),
        ("--time-unit <UNIT>", "ms"),
        ("--date-order <FIRST>", "day"),
        ("--zone <ZONE>", "Europe/Berlin"),
    ] {
        let error = timed(option.split(' ').next().unwrap(), value);
        let says = format!("'--sample-time <SECONDS>' cannot be used with '{option}'");
        assert!(error.contains(&says), "{error}");
    }
    for (option, value) in [("--column", "t=t"), ("--unit", "t=1e-3")] {
        let error = timed(option, value);
        let says = format!("--sample-time 0.0005 and {option} {value}: the time is from one of them");
        assert!(error.contains(&says), "{error}");
    }
}

/// A bootstrap that is ended has the intervals of the refits so far.
#[cfg(unix)]
#[test]
fn an_ended_bootstrap_has_the_refits_so_far() {
    use std::process::{Command, Stdio};
    let bench = Bench::new();
    bench.ends(0, &["fit", "pmsm.toml", "record.csv", "--json", "e.json"]);
    let words = ["bootstrap", "pmsm.toml", "record.csv", "--estimate", "e.json", "--refits", "1000000"];
    let run = bench.command(&words).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    std::thread::sleep(std::time::Duration::from_secs(6));
    // The shell has it where there is no such program.
    let kill = format!("kill -INT {}", run.id());
    assert!(Command::new("sh").args(["-c", &kill]).status().unwrap().success());
    let Output { status, stdout, stderr } = run.wait_with_output().unwrap();
    let error = String::from_utf8(stderr).unwrap();
    assert!(status.code() == Some(0), "{error}");
    let number = |text: &str, before: &str| text.split(before).nth(1)?.split_whitespace().next()?.parse::<u64>().ok();
    let tried = number(&error, "ended after ");
    assert!(tried.is_some_and(|tried| (20..1_000_000).contains(&tried)), "{error}");
    let out = String::from_utf8(stdout).unwrap();
    assert!(out.contains(&format!("of {} refits ended", tried.unwrap())), "{out}");
}

/// Two lags under one input, one twice as fast: each record has the parameter of its own, wherever it is asked for.
#[test]
fn each_record_has_its_own_parameter() {
    let bench = Bench::new();
    let model = "greybox = 1\n[inputs]\nu = \"1\"\n[parameters]\np = { unit = \"1/s\", start = 1.0 }\n[states]\n\
                 x = { unit = \"1\", derivative = \"p*(u - x)\", initial = 0 }\n[outputs]\nx = \"x\"\n";
    std::fs::write(bench.path("lag.toml"), model).unwrap();
    for (name, p) in [("slow", 2.0f64), ("fast", 4.0)] {
        let (mut x, mut text) = (0.0f64, "t,u,x\n".to_owned());
        for k in 0..200 {
            let u = f64::from(k / 20 % 2);
            text += &format!("{},{u},{}\n", 0.1 * f64::from(k), x + 0.01 * f64::from(k * 37 % 21 - 10) / 10.0);
            x = u + (x - u) * (-0.1 * p).exp();
        }
        std::fs::write(bench.path(&format!("{name}.csv")), text).unwrap();
    }
    let records = ["slow.csv", "fast.csv", "--per-record", "p"];
    let fit = [&["fit", "lag.toml"], &records[..], &["--derived", "tau=1/p", "--json", "e.json"]].concat();
    let out = String::from_utf8_lossy(&bench.run(&fit).stdout).into_owned();
    let tau = |name: &str| {
        let found = out.lines().find_map(|line| line.strip_prefix(&format!("tau [{name}] = ")));
        found.and_then(|rest| rest.split(',').next()?.parse::<f64>().ok()).unwrap_or(f64::NAN)
    };
    assert!((tau("slow") - 0.5).abs() < 2e-3 && (tau("fast") - 0.25).abs() < 2e-3, "{out}");
    let compare = [&["compare", "--model", "lag.toml:e.json"], &records[..]].concat();
    let out = String::from_utf8_lossy(&bench.run(&compare).stdout).into_owned();
    let fits: Vec<f64> = out
        .lines()
        .filter(|line| line.contains("estimation"))
        .filter_map(|line| line.split_whitespace().find_map(|word| word.parse().ok().filter(|fit| *fit > 1.0)))
        .collect();
    assert!(fits.len() == 2 && fits.iter().all(|fit| *fit > 95.0), "{out}");
    // Of two records of one name each has its own, too.
    for name in ["slow", "fast"] {
        std::fs::create_dir(bench.path(name)).unwrap();
        std::fs::copy(bench.path(&format!("{name}.csv")), bench.path(&format!("{name}/run.csv"))).unwrap();
    }
    let twins = ["lag.toml", "--per-record", "p", "slow/run.csv", "fast/run.csv"];
    bench.run(&[&["fit", "--json", "twins.json"], &twins[..]].concat());
    let stored = ["lag.toml:twins.json", "--per-record", "p", "slow/run.csv", "fast/run.csv"];
    for (words, is_stored) in [(&twins[..], false), (&stored[..], true)] {
        let Output { stdout, stderr, .. } = bench.run(&[&["compare", "--model"], words].concat());
        let [out, remarks] = [stdout, stderr].map(|text| String::from_utf8(text).unwrap());
        let percents =
            out.lines().filter(|line| line.contains("estimation") && line.contains("run #")).filter_map(|line| {
                line.split_whitespace().find_map(|one| one.parse::<f64>().ok().filter(|fit| *fit > 1.0))
            });
        assert!(percents.filter(|fit| *fit > 95.0).count() == 2, "{out}");
        let places = "slow/run.csv of `run #1`, fast/run.csv of `run #2`";
        assert!(remarks.contains(places) == is_stored, "{remarks}");
        // One that was not fitted has none, whatever its name.
        for other in ["slow.csv", "slow/run.csv"] {
            let words = [&["compare", "-q", "--model"], words, &["--validation", other]].concat();
            let (_, error) = bench.ends(1, &words);
            assert!(error.contains(&format!("error: {other}: parameter `p` of lag.toml")), "{error}");
        }
    }
    let last = |words: &[&str]| {
        let (out, _) = bench.ends(0, words);
        out.lines().nth(22).unwrap().rsplit(',').next().unwrap().parse::<f64>().unwrap()
    };
    // A tenth of a second after the first step.
    let fast = last(&["simulate", "lag.toml", "fast.csv", "--estimate", "e.json"]);
    assert!((fast - (1.0 - (-0.4f64).exp())).abs() < 5e-3, "{fast}");
    // What the command line gives needs no record.
    std::fs::copy(bench.path("fast.csv"), bench.path("other.csv")).unwrap();
    let given = last(&["simulate", "lag.toml", "other.csv", "--estimate", "e.json", "--set", "p=4"]);
    assert!((given - fast).abs() < 5e-3, "{given} {fast}");
    let (_, error) = bench.ends(1, &["simulate", "lag.toml", "other.csv", "--estimate", "e.json"]);
    assert!(
        error.contains("`p` has a value for each record of the fit, and this is none of them (slow, fast;"),
        "{error}"
    );
}

/// From the first sample, which the file has; without the outputs there it cannot be.
#[test]
fn a_simulation_begins_at_the_first_sample() {
    let bench = Bench::new();
    let (out, _) = bench.ends(0, &["simulate", "pmsm.toml", "record.csv", "--initial", "first"]);
    let text = std::fs::read_to_string(bench.path("record.csv")).unwrap();
    let currents = |line: &str| line.split(',').rev().take(2).map(|cell| cell.parse().unwrap()).collect::<Vec<f64>>();
    assert_eq!(currents(out.lines().nth(1).unwrap()), currents(text.lines().nth(1).unwrap()));
    let inputs: String =
        text.lines().map(|line| line.split(',').take(4).collect::<Vec<_>>().join(",") + "\n").collect();
    std::fs::write(bench.path("inputs.csv"), inputs).unwrap();
    let (_, error) = bench.ends(1, &["simulate", "pmsm.toml", "inputs.csv", "--initial", "first"]);
    assert!(error.contains("no column `id`"), "{error}");
}

/// Its state at the first sample is of the fit's record of its name alone; any other begins as the model says.
#[test]
fn a_record_of_another_name_begins_as_the_model_says() {
    let bench = Bench::new();
    let model = "greybox = 1\n[inputs]\nroom = \"degC\"\n[parameters]\nk = { unit = \"1/s\", start = 1.0 }\n[states]\n\
                 body = { unit = \"degC\", derivative = \"k*(room - body)\", initial = \"first\" }\n[outputs]\nbody = \"body\"\n";
    std::fs::write(bench.path("cooling.toml"), model).unwrap();
    for (name, start) in [("warm", 80.0), ("cold", 5.0)] {
        let row = |k: i32| {
            let t = 0.1 * f64::from(k);
            format!("{t},20,{}\n", 20.0 + (start - 20.0) * (-0.5 * t).exp() + 0.01 * f64::from(k * 37 % 21 - 10))
        };
        let rows: String = (0..100).map(row).collect();
        std::fs::write(bench.path(&format!("{name}.csv")), format!("t,room,body\n{rows}")).unwrap();
    }
    bench.run(&["fit", "cooling.toml", "warm.csv", "--json", "e.json"]);
    let begins = |words: &[&str]| {
        let (out, remarks) = bench.ends(0, &[&["simulate", "cooling.toml"], words].concat());
        let cell = out.lines().nth(1).unwrap().rsplit(',').next().unwrap().parse::<f64>().unwrap();
        (cell, remarks)
    };
    // The measured ones are off by 0.1 degC at the first sample.
    let (warm, remarks) = begins(&["warm.csv", "--estimate", "e.json"]);
    assert!(
        (warm - 80.0).abs() < 0.2 && remarks.contains("record `warm` of the estimate begins at body = "),
        "{remarks}"
    );
    let (cold, remarks) = begins(&["cold.csv", "--estimate", "e.json"]);
    assert!((cold - 5.0).abs() < 0.2 && remarks.contains("as the model says, or from zero"), "{cold} {remarks}");
    let (_, remarks) = begins(&["cold.csv"]);
    assert!(remarks.contains("the values of k are the starts of a fit"), "{remarks}");
    let (zero, remarks) = begins(&["cold.csv", "--initial", "body=0", "--fix", "k=0.5"]);
    assert!(zero == 0.0 && !remarks.contains("starts") && !remarks.contains("record begins"), "{remarks}");
}
