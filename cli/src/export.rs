//! `export`: a model in another language.

use crate::arguments::{Export, Language};
use crate::fitting::model;
use crate::terminal::Terminal;
use crate::{Failure, Verdict, output};
use std::path::PathBuf;

pub fn run(one: &Export, terminal: &Terminal) -> Result<Verdict, Failure> {
    output::check(one.out.as_deref(), &[])?;
    output::apart([&one.out], one.model.iter().map(PathBuf::from))?;
    let model = model(one.model.as_deref(), &one.constant, terminal)?;
    let text = match one.language {
        Language::Toml => model.to_toml(),
        Language::Rust => model.to_rust()?,
        Language::Latex => model.to_latex(),
        Language::Markdown => model.to_markdown(),
        Language::Json => serde_json::to_string_pretty(&**model.equations())?,
    };
    let text = format!("{}\n", text.trim_end());
    output::write(one.out.as_deref(), text.as_bytes())?;
    Ok(Verdict::Usable)
}
