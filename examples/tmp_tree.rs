use greybox::{Elimination, Information};
use std::time::Instant;
fn main() {
    let records = 100_000;
    let mut bits = 1u64;
    let mut next = || {
        bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (bits >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let t: Vec<Information> = (0..records)
        .map(|_| {
            let mut triangle = Information::new(5);
            (0..6).for_each(|_| triangle.absorb_row(&[next(), next(), next(), next(), next()], next()));
            triangle
        })
        .collect();
    let scores = t.clone();
    macro_rules! time {
        ($name:literal, $e:expr) => {{
            let b = Instant::now();
            let r = $e;
            println!("{:20} {:.1} ms", $name, b.elapsed().as_secs_f64() * 1e3);
            r
        }};
    }
    for _ in 0..2 {
        let t2 = t.clone();
        let tree = time!("of_records", Elimination::of_records(3, t2));
        let n = tree.unknowns();
        let damping: Vec<f64> = tree.column_norms().iter().map(|norm| 1e-3 * norm).collect();
        time!("gradient", tree.gradient());
        time!("sum_of_squares", tree.sum_of_squares());
        let s = time!("step undamped", tree.step(&[], &[])).unwrap();
        time!("step damped", tree.step(&damping, &[]));
        time!("predicted", tree.predicted_reduction(&s));
        time!("step_within", tree.step_within(&damping, &[], &vec![(-0.5, 0.5); n]));
        let held = time!("undetermined", tree.undetermined(&[], 1e-11)).held;
        let c = time!("covariance", tree.covariance(&held)).unwrap();
        let s = time!("sandwich", tree.sandwich(&held, &scores)).unwrap();
        time!("errors", (0..n).map(|i| c.standard_error(i)).sum::<f64>());
        time!("errors sandwich", (0..n).map(|i| s.standard_error(i)).sum::<f64>());
    }
}
