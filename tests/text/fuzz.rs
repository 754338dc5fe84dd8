//! Texts at random: bytes, and the models that ship with pieces of them exchanged. Whatever they are, they are read or refused with
//! a message. `GREYBOX_FUZZ_SECONDS=3600 cargo test --test text fuzz` goes on for an hour.

use crate::meaning::PMSM;
use greybox::text::{Model, shipped};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use std::time::{Duration, Instant};

const PIECES: &[&str] = &[
    "(",
    ")",
    "^",
    "**",
    "-",
    "*",
    "/",
    "if ",
    " then ",
    " else ",
    " and ",
    " or ",
    "not ",
    "<",
    ">=",
    "==",
    "\"",
    "\"\"\"",
    "'",
    "'''",
    "{",
    "}",
    "[",
    "]",
    "\n",
    "\\",
    "\\u00b5",
    "\\",
    "#",
    "=",
    ".",
    ",",
    "µ",
    "°",
    "e",
    "1e999",
    "nan",
    "inf",
    "0",
    "1",
    "t",
    "pi",
    "id",
    "rs",
    "sqrt(",
    "rem_euclid(",
    "psi.x(",
    "[let]\n",
    "[states]\n",
    "unit = ",
    "initial = \"first\"",
    "next",
    "`",
    "\u{feff}",
    "\r\n",
    "a = \"b\"\nb = \"a\"\n",
    "log = true",
    "within = [1, 0]",
];

fn below(random: &mut Xoshiro256PlusPlus, n: usize) -> usize {
    (random.next_u64() % n.max(1) as u64) as usize
}

/// A place between two characters.
fn place(random: &mut Xoshiro256PlusPlus, text: &str) -> usize {
    let mut at = below(random, text.len() + 1);
    while !text.is_char_boundary(at) {
        at -= 1;
    }
    at
}

fn mutated(random: &mut Xoshiro256PlusPlus, texts: &[&str]) -> String {
    let mut text = texts[below(random, texts.len())].to_owned();
    for _ in 0..=below(random, 4) {
        let (a, b) = (place(random, &text), place(random, &text));
        let (a, b) = (a.min(b), a.max(b).min(a.min(b) + 40));
        let b = (a..=b).rev().find(|b| text.is_char_boundary(*b)).unwrap_or(a);
        match below(random, 5) {
            0 => text.insert_str(a, PIECES[below(random, PIECES.len())]),
            1 => text.replace_range(a..b, PIECES[below(random, PIECES.len())]),
            2 => text.replace_range(a..b, ""),
            3 => {
                let piece = text[a..b].to_owned();
                let at = place(random, &text);
                text.insert_str(at, &piece);
            }
            _ => text.insert_str(a, &PIECES[below(random, PIECES.len())].repeat(1 + below(random, 300))),
        }
    }
    text
}

#[test]
fn any_text_is_read_or_refused() {
    let seconds = std::env::var("GREYBOX_FUZZ_SECONDS").ok().and_then(|seconds| seconds.parse().ok()).unwrap_or(3);
    let texts: Vec<&str> = shipped().iter().map(|one| one.text).chain([PMSM]).collect();
    let (mut random, begin) = (Xoshiro256PlusPlus::seed_from_u64(1), Instant::now());
    let mut read = 0u64;
    for case in 0.. {
        if begin.elapsed() > Duration::from_secs(seconds) {
            assert!(case > 100 && read > 5, "{read} of {case} texts were models");
            break;
        }
        let text = match case % 4 {
            0 => {
                let bytes: Vec<u8> = (0..below(&mut random, 200)).map(|_| random.next_u64() as u8).collect();
                String::from_utf8_lossy(&bytes).into_owned()
            }
            _ => mutated(&mut random, &texts),
        };
        match Model::named("model.toml", &text) {
            Ok(mut model) => {
                read += 1;
                model.warnings().iter().for_each(|warning| assert!(!warning.to_string().is_empty()));
                let _ = model.set_constant("np", 2.0);
                let again =
                    Model::named("model.toml", &model.to_toml()).unwrap_or_else(|error| panic!("{text}\n{error}"));
                assert_eq!(again.equations().layout(), model.equations().layout());
            }
            Err(error) => {
                assert!(!error.to_string().is_empty() && error.remarks().iter().all(|one| one.line() > 0), "{text}")
            }
        }
    }
}
