//! A folder in which the command runs.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::atomic::{AtomicUsize, Ordering};

/// The shipped record of a motor with four pole pairs.
pub fn record() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/data/pmsm.csv")
}

pub const MODEL: &str = r#"
greybox = 1
name = "PMSM"
[constants]
np = 4
[inputs]
ud = "V"
uq = "V"
w = "rad/s"
[parameters]
rs = { unit = "ohm", start = 1.0, within = [0.01, 10] }
ls = { unit = "H", start = 2e-3, positive = true }
ke = { unit = "V s/rad", start = 0.7 }
[let]
we = "np*w"
[states]
id = { unit = "A", derivative = "(ud - rs*id)/ls + we*iq" }
iq = { unit = "A", derivative = "(uq - rs*iq - ke*w*sqrt(2/3))/ls - we*id" }
[outputs]
id = "id"
iq = "iq"
"#;

/// A folder with the model, in which the command runs.
pub struct Bench(PathBuf);

impl Drop for Bench {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

impl Bench {
    pub fn new() -> Self {
        static COUNT: AtomicUsize = AtomicUsize::new(0);
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let bench = Bench(std::env::temp_dir().join(format!("greybox_command_{}_{number}", std::process::id())));
        std::fs::create_dir_all(&bench.0).unwrap();
        std::fs::write(bench.path("pmsm.toml"), MODEL).unwrap();
        std::fs::copy(record(), bench.path("record.csv")).unwrap();
        bench
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// The command in the folder, to be run.
    pub fn command(&self, words: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_greybox"));
        command.args(words).current_dir(&self.0).env_remove("NO_COLOR");
        command
    }

    pub fn run(&self, words: &[&str]) -> Output {
        self.command(words).output().unwrap()
    }

    /// What a command prints that ends with this code.
    pub fn ends(&self, code: i32, words: &[&str]) -> (String, String) {
        let Output { status, stdout, stderr } = self.run(words);
        let [out, error] = [stdout, stderr].map(|bytes| String::from_utf8(bytes).unwrap());
        assert_eq!(status.code(), Some(code), "{words:?}\n{out}\n{error}");
        (out, error)
    }

    pub fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(&self.0).unwrap();
        let mut names: Vec<String> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

/// A parameter's value in a table of an estimate.
pub fn value(out: &str, name: &str) -> f64 {
    let line = out.lines().find(|line| line.split_whitespace().next() == Some(name));
    let line = line.unwrap_or_else(|| panic!("no row `{name}` in\n{out}"));
    line.split_whitespace().nth(1).unwrap().parse().unwrap()
}
