//! Covariances without the dense matrix, against the dense one.

use super::{Problem, Random, random_tree};
use greybox::information::{Covariance, Information};
use greybox::nalgebra::DMatrix;

/// Relative to the given variances. Condition below a few hundred, its square in the inverse.
const ROUNDING: f64 = 1e-11;

fn problems() -> impl Iterator<Item = (Problem, Vec<bool>, Random)> {
    (0..60).map(|seed| {
        let mut random = Random::new(500 + seed);
        let (shared, records) = (1 + random.below(3), 1 + random.below(4));
        let pieces = random_tree(shared, records, &mut random);
        // Units that differ by many orders of magnitude.
        let problem = Problem::new(shared, &pieces, 9, &mut random, |i, x| x * 10f64.powi(4 - (i % 9) as i32));
        let held = (0..problem.unknowns()).map(|_| seed % 3 == 2 && random.next() > 0.4).collect();
        (problem, held, random)
    })
}

#[track_caller]
fn check(found: &Covariance, expected: &DMatrix<f64>, variances: &DMatrix<f64>) {
    let n = expected.nrows();
    assert_eq!(found.size(), n);
    let all: Vec<usize> = (0..n).collect();
    let dense = found.dense(&all);
    for i in 0..n {
        for j in 0..n {
            let scale = (variances[(i, i)] * variances[(j, j)]).sqrt();
            let error = (found.get(i, j) - expected[(i, j)]).abs();
            assert!(error <= ROUNDING * scale, "{i} {j}: {} and {}", found.get(i, j), expected[(i, j)]);
            assert!((dense[(i, j)] - found.get(i, j)).abs() <= 1e-15 * scale);
            assert_eq!(dense[(i, j)], dense[(j, i)]);
        }
        assert!((found.standard_error(i).powi(2) - found.get(i, i)).abs() <= 1e-15 * variances[(i, i)]);
        assert_eq!(found.diagonal()[i], found.get(i, i));
    }
}

#[test]
fn the_inverse_is_the_dense_one() {
    for (problem, held, _) in problems() {
        let covariance = problem.tree.covariance(&held).expect("it is determined");
        let inverse = problem.dense_inverse(&held);
        check(&covariance, &inverse, &inverse);
        for i in (0..held.len()).filter(|&i| held[i]) {
            assert_eq!((covariance.get(i, i), covariance.get(0, i), covariance.standard_error(i)), (0.0, 0.0, 0.0));
        }
    }
}

#[test]
fn the_sandwich_is_the_dense_one() {
    for (problem, held, mut random) in problems() {
        let n = problem.unknowns();
        let mut meat = DMatrix::zeros(n, n);
        let mut scores = vec![];
        for ((_, columns), rows) in problem.tree.columns().zip(&problem.rows_of) {
            let mut triangle = Information::new(columns.len());
            for row in rows.clone() {
                let influence = random.next();
                let score: Vec<f64> = columns.iter().map(|&i| problem.jacobian[(row, i)] * influence).collect();
                triangle.absorb_row(&score, random.next());
                let score = problem.jacobian.row(row) * influence;
                meat += score.transpose() * score;
            }
            scores.push(triangle);
        }
        let inverse = problem.dense_inverse(&held);
        let expected = &inverse * meat * &inverse;
        let sandwich = problem.tree.sandwich(&held, &scores).expect("it is determined");
        check(&sandwich, &expected, &inverse);
        // Scores of one piece alone: the others' triangles may be missing.
        let first = problem.tree.sandwich(&held, &scores[..1]).expect("it is determined");
        let rows = &scores[0];
        let (_, columns) = problem.tree.columns().next().expect("a piece");
        let root = DMatrix::from_fn(columns.len(), n, |i, j| {
            columns.iter().position(|&c| c == j).map_or(0.0, |c| rows.at(i, c))
        });
        check(&first, &(&inverse * root.transpose() * &root * &inverse), &inverse);
    }
}

/// Scores with the covariance of the rows themselves: the sandwich is the inverse.
#[test]
fn a_sandwich_of_white_errors_is_the_inverse() {
    for (problem, held, _) in problems() {
        let scores: Vec<Information> = problem.tree.columns().map(|(triangle, _)| triangle.clone()).collect();
        let sandwich = problem.tree.sandwich(&held, &scores).expect("it is determined");
        let inverse = problem.dense_inverse(&held);
        check(&sandwich, &inverse, &inverse);
    }
}

#[test]
fn scales_and_stored_covariances() {
    let (problem, held, _) = problems().nth(32).expect("sixty");
    let n = problem.unknowns();
    let scores: Vec<Information> = problem.tree.columns().map(|(triangle, _)| triangle.clone()).collect();
    let plain = problem.tree.covariance(&held).expect("it is determined");
    let sandwich = problem.tree.sandwich(&held, &scores).expect("it is determined");
    for covariance in [plain, sandwich] {
        let text = serde_json::to_string(&covariance).expect("finite numbers");
        let back: Covariance = serde_json::from_str(&text).expect("as it was stored");
        assert_eq!(back, covariance);
        let factors: Vec<f64> = (0..n).map(|i| i as f64).collect();
        let scaled = covariance.clone().scaled(&factors).times(4.0);
        assert_eq!((scaled.get(0, 1), scaled.standard_error(0)), (0.0, 0.0), "a factor of zero");
        for (i, j) in [(1, 1), (1, n - 1), (2, 3)] {
            let expected = covariance.get(i, j) * 4.0 * factors[i] * factors[j];
            assert!((scaled.get(i, j) - expected).abs() <= 1e-15 * expected.abs());
        }
        assert_eq!((covariance.get(n, 0), covariance.standard_error(n)), (0.0, 0.0), "there is no such unknown");
    }
    assert_eq!(Covariance::zeros(3).dense(&[0, 2]), greybox::information::SquareMatrix::zeros(2));
}

/// A stored covariance is checked: every index and length that the answers rely on.
#[test]
fn a_damaged_covariance_is_refused() {
    let piece = r#"{"parent":0,"own":[1,2],"border":[0],"gain":[0.5,0.5],"variance":[1.0,0.0,0.0,1.0]}"#;
    let whole = format!(
        r#"{{"scales":[1.0,1.0,1.0],"parts":[{{"parent":0,"own":[0],"border":[],"gain":[],"variance":[4.0]}},{piece}]}}"#
    );
    let read = |text: &str| serde_json::from_str::<Covariance>(text).map_err(|error| error.to_string());
    let good = read(&whole).expect("it is right");
    // x = z - gain border: 1 + 0.25 * 4, and -0.5 * 4.
    assert_eq!((good.get(1, 1), good.get(1, 2), good.get(2, 0)), (2.0, 1.0, -2.0));
    for (from, to, what) in [
        (r#""own":[1,2]"#, r#""own":[2,1]"#, "out of order"),
        (r#""own":[1,2]"#, r#""own":[1,3]"#, "out of range"),
        (r#""own":[1,2]"#, r#""own":[0,2]"#, "another part"),
        (r#""border":[0]"#, r#""border":[2]"#, "does not know"),
        (r#""border":[0]"#, r#""border":[]"#, "do not fit"),
        (r#""gain":[0.5,0.5]"#, r#""gain":[0.5]"#, "do not fit"),
        (r#"{"parent":0,"own":[1"#, r#"{"parent":1,"own":[1"#, "below one before it"),
        (
            r#""variance":[4.0]"#,
            r#""variance":[4.0],"scores":{"response":[1.0],"passed":[]}"#,
            "where another has none",
        ),
        (r#"1.0]}]"#, r#"1.0],"more":1}]"#, "unknown field"),
    ] {
        let damaged = whole.replacen(from, to, 1);
        assert_ne!(damaged, whole);
        let error = read(&damaged).expect_err(what);
        assert!(error.contains(what), "{what}: {error}");
    }
    assert!(read(r#"{"scales":[],"parts":[]}"#).is_err());
}
