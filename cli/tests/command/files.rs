//! What a file says twice: signals called as the time is, and a sample time beside a column of another.

use crate::bench::{Bench, record};

/// A lag whose measured output is called `time`, and its record of these rows.
fn bench(rows: impl Fn(u32) -> String, header: &str) -> Bench {
    let bench = Bench::new();
    let model = "greybox = 1\n[inputs]\nu = \"1\"\n[parameters]\np = { unit = \"1/s\", start = 1.0 }\n[states]\n\
                 x = { unit = \"1\", derivative = \"p*(u - x)\", initial = 0 }\n[outputs]\ntime = { value = \"x\", unit = \"1\" }\n";
    std::fs::write(bench.path("lag.toml"), model).unwrap();
    let text: String = (0..50).map(|k| rows(k) + "\n").collect();
    std::fs::write(bench.path("lag.csv"), format!("{header}\n{text}")).unwrap();
    bench
}

#[test]
fn a_signal_may_be_called_time() {
    let seconds = |k: u32| 0.1 * f64::from(k);
    let x = move |k: u32| 1.0 - (-2.0 * seconds(k)).exp();
    let converted = |header: &str, rows: &dyn Fn(u32) -> String| {
        let (out, _) = bench(rows, header).ends(0, &["convert", "lag.toml", "lag.csv"]);
        let cells: Vec<f64> = out.lines().nth(11).unwrap().split(',').map(|cell| cell.parse().unwrap()).collect();
        assert!((cells[0] - 1.0).abs() < 1e-12 && cells[1] == 1.0 && (cells[2] - x(10)).abs() < 1e-12, "{out}");
    };
    converted("t,u,time", &|k| format!("{},1,{}", seconds(k), x(k)));
    converted("time,u,timestamp", &|k| format!("{},1,{}", x(k), seconds(k)));
    let alone = bench(|k| format!("1,{}", x(k)), "u,time");
    let (_, error) = alone.ends(1, &["convert", "lag.toml", "lag.csv"]);
    assert!(error.contains("column `time` holds a signal of the model, so that it is not the time"), "{error}");
    assert!(error.contains("say which one holds the time by --time, or give --sample-time"), "{error}");
    let (out, _) = alone.ends(0, &["convert", "lag.toml", "lag.csv", "--sample-time", "0.1"]);
    assert!(out.lines().nth(3).unwrap().starts_with("0.2,1.0,"), "{out}");
    // What is said counts.
    alone.ends(0, &["convert", "lag.toml", "lag.csv", "--time", "time"]);
}

/// The shipped record has 0.25 ms between samples.
#[test]
fn a_sample_time_agrees_with_the_column() {
    let bench = Bench::new();
    let says = |step: &str, file: &str| bench.ends(1, &["convert", "pmsm.toml", file, "--sample-time", step]).1;
    let error = says("1e-3", "record.csv");
    let expected = "record.csv: --sample-time of 0.001 s and column `t`, where 0.00025 s lie between samples, both give the time: leave the sample time out";
    assert!(error.contains(expected), "{error}");
    bench.ends(0, &["convert", "pmsm.toml", "record.csv", "--sample-time", "2.5e-4"]);
    // Rounded times are the same, times that go back are others, and what is no time is none.
    let text = std::fs::read_to_string(record()).unwrap();
    let with = |name: &str, time: &dyn Fn(usize) -> String| {
        let row = |(k, line): (usize, &str)| format!("{},{}\n", time(k), line.split_once(',').unwrap().1);
        let rows: String = text.lines().skip(1).enumerate().map(row).collect();
        std::fs::write(bench.path(name), format!("t,ud,uq,w,id,iq\n{rows}")).unwrap();
    };
    with("rounded.csv", &|k| format!("{:.6}", 1e-3 / 3.0 * k as f64));
    bench.ends(0, &["convert", "pmsm.toml", "rounded.csv", "--sample-time", "3.3333e-4"]);
    with("back.csv", &|k| format!("{}", 0.1 * (k % 1000) as f64));
    assert!(says("0.1", "back.csv").contains("column `t`, where -99.9 s lie between samples"));
    with("dates.csv", &|k| format!("2025-03-20 14:{:02}:{:02}", k / 60, k % 60));
    assert!(says("0.5", "dates.csv").contains("column `t`, where 1 s lie between samples"));
    bench.ends(0, &["convert", "pmsm.toml", "dates.csv", "--sample-time", "1"]);
    with("none.csv", &|k| format!("row {k}"));
    let (out, _) = bench.ends(0, &["convert", "pmsm.toml", "none.csv", "--sample-time", "0.25"]);
    assert!(out.lines().nth(3).unwrap().starts_with("0.5,"), "{out}");
}
