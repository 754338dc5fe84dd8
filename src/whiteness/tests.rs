//! Autocorrelations, portmanteau tests and autoregressions by hand.

use super::*;

fn coefficients(of: &Autocorrelation) -> Vec<f64> {
    of.sums[1..].iter().map(|sum| sum / of.sums[0]).collect()
}

/// In one run or in many, the sums are those of the definition.
#[test]
fn runs_make_the_whole() {
    let e: Vec<f64> = (0..300).map(|k| ((k * k) as f64 * 0.37).sin()).collect();
    let mut runs = Autocorrelation::new(12);
    for run in [&e[..5], &e[5..133], &e[133..134], &e[134..]] {
        runs.add(run);
    }
    let whole: f64 = e.iter().map(|e| e * e).sum();
    for (k, found) in coefficients(&runs).into_iter().enumerate() {
        let expected = (k + 1..300).map(|t| e[t] * e[t - k - 1]).sum::<f64>() / whole;
        assert!((found - expected).abs() < 1e-14, "lag {}: {found} {expected}", k + 1);
    }
    // So do pieces of any length, each with its own runs.
    for cuts in [[100, 200], [5, 8], [1, 299], [290, 295]] {
        let piece = |e: &[f64]| {
            let mut piece = Autocorrelation::new(12);
            e.chunks(7).for_each(|run| piece.add(run));
            piece
        };
        let [a, b] = cuts;
        let mut joined = piece(&e[..a]);
        joined.follow(&piece(&e[a..b]));
        joined.follow(&piece(&e[b..]));
        for (found, expected) in coefficients(&joined).iter().zip(coefficients(&runs)) {
            assert!((found - expected).abs() < 1e-14, "{cuts:?}: {found} {expected}");
        }
    }
}

/// Pieces of a record that follow one another have the neighbors of the whole; records beside one another do not.
#[test]
fn pieces_have_the_neighbors_of_the_whole() {
    let e: Vec<f64> = (0..90).map(|k| if k % 7 == 0 { 0.0 } else { ((k * k) as f64 * 0.37).sin() }).collect();
    let counts = |runs: &[&[f64]]| {
        let mut pieces = runs.iter().map(|run| {
            let mut piece = Neighbors::default();
            run.chunks(4).for_each(|run| piece.add(run));
            piece
        });
        let mut whole = pieces.next().unwrap();
        pieces.for_each(|piece| whole.follow(&piece));
        [whole.errors, whole.pairs, whole.agreements]
    };
    let sign = |e: f64| if e == 0.0 { 0.0 } else { e.signum() };
    let pairs = || e.windows(2).map(|pair| sign(pair[0]) * sign(pair[1]));
    let expected: [f64; 3] = [e.iter().map(|e| sign(*e).abs()).sum(), pairs().map(f64::abs).sum(), pairs().sum()];
    for cuts in [vec![&e[..]], vec![&e[..14], &e[14..15], &e[15..]], vec![&[], &e[..60], &[], &e[60..]]] {
        assert_eq!(counts(&cuts).map(|count| count as f64), expected, "{cuts:?}");
    }
    let (mut one, mut other) = (Neighbors::default(), Neighbors::default());
    one.add(&[1.0, 2.0]);
    other.add(&[3.0, -1.0]);
    one.append(&other);
    assert_eq!([one.errors, one.pairs, one.agreements], [4, 2, 0]);
}

/// `e[t] = 0.5 e[t - 1] + 0.3 e[t - 2] + w[t]`: correlations `0.5 / 0.7` and `0.5 rho + 0.3`, and the variance of the
/// innovations `1 - 0.5 rho[1] - 0.3 rho[2]`; higher orders add nothing.
#[test]
fn recursion_finds_an_autoregression_of_second_order() {
    let mut rho = vec![1.0, 0.5 / 0.7];
    (2..5).for_each(|k| rho.push(0.5 * rho[k - 1] + 0.3 * rho[k - 2]));
    let mut orders = vec![];
    levinson_durbin(&rho[1..], |a, variance| orders.push((a.to_vec(), variance)));
    assert_eq!(orders.len(), 4);
    let expected = 1.0 - 0.5 * rho[1] - 0.3 * rho[2];
    for (a, variance) in &orders[1..] {
        let wrong = a.iter().zip([0.5, 0.3, 0.0, 0.0]).map(|(a, expected)| (a - expected).abs()).fold(0.0, f64::max);
        // A dozen roundings.
        assert!(wrong < 1e-14 && (variance - expected).abs() < 1e-14, "{a:?} {variance}");
    }
    levinson_durbin(&[1.0], |_, _| panic!("a correlation of one has no innovations"));
}

/// White noise is called colored as often as the level says, where chi squared would say so six times as often: few errors, and
/// errors whose size falls to a sixth. Of 20,000 series 20 are expected below 1e-3, and half to twice as many may be found, give or take two standard deviations of a small count.
#[test]
fn a_p_value_is_how_often_chance_shows_as_much() {
    let mut random = crate::random::Random::stream(11, 0);
    type Size = fn(f64) -> f64;
    let cases: [(usize, Size); 2] = [(80, |_| 1.0), (200, |part| 0.5 + 2.5 * (-6.0 * part).exp())];
    for (count, size) in cases {
        let mut found = [0; 2];
        for _ in 0..20_000 {
            let run: Vec<f64> = (0..count).map(|k| size(k as f64 / count as f64) * random.normal()).collect();
            let mut test = Portmanteau::new(20);
            test.add(&run);
            let p = test.p_value(20);
            let squares = (1..=20).map(|lag| test.at(lag).0.powi(2)).sum::<f64>();
            found[0] += usize::from(p < 1e-3);
            found[1] += usize::from(chi_squared_tail(squares, 20.0) < 1e-3);
        }
        assert!((8..=42).contains(&found[0]) && found[1] > 80, "{count}: {found:?}");
    }
}

/// Squares that overflow give no result, and do not panic.
#[test]
fn huge_errors_have_a_p_value() {
    for size in [1e80, 1e160, f64::MAX] {
        let mut test = Portmanteau::new(20);
        test.add(&(0..40).map(|k| size * f64::from(k % 3 - 1)).collect::<Vec<_>>());
        assert!((0.0..=1.0).contains(&test.p_value(20)), "{size}");
    }
}

/// By hand: n = 10, rho = (0.5, -0.2) gives 10 * 12 * (0.25 / 9 + 0.04 / 8); two degrees of freedom have the tail
/// `exp(-q / 2)`.
#[test]
fn ljung_box_by_hand() {
    let (q, p) = ljung_box(&[0.5, -0.2], 10);
    let expected = 120.0 * (0.25 / 9.0 + 0.005);
    assert!((q - expected).abs() < 1e-12, "{q}");
    assert!((p - (-expected / 2.0).exp()).abs() < 1e-10, "{p}");
}

/// By hand: e = (1, 2, -1, 3) has products 2, -2, -3 at lag one and -1, 6 at lag two.
#[test]
fn portmanteau_by_hand() {
    let mut test = Portmanteau::new(2);
    test.add(&[1.0, 2.0]);
    test.add(&[-1.0, 3.0]);
    let (one, two) = (-3.0 / 17f64.sqrt(), 5.0 / 37f64.sqrt());
    assert!((test.at(1).0 - one).abs() < 1e-15 && (test.at(2).0 - two).abs() < 1e-15);
    assert!((test.at(1).1 + 3.0 / 15.0).abs() < 1e-15);
    // Two degrees of freedom have the tail `exp(-q / 2)`.
    let expected = (-(one * one + two * two) / 2.0).exp();
    assert!((test.p_value(2) - expected).abs() < 1e-12, "{}", test.p_value(2));
    // Of three pairs one agrees in sign: a square of 1 / 3; of four errors, that of their correlation is 4 (3 / 15)^2,
    // which is less. The tail of a standard normal square at 0.16 is 0.689157.
    assert!((test.neighbors_p_value() - 0.689157).abs() < 1e-6, "{}", test.neighbors_p_value());
    // The autocorrelations are -3/15 and 5/15; a reduction by 1/4 leaves nothing of the first.
    let less = test.without(0.25);
    assert_eq!(less.at(1), (0.0, 0.0));
    assert!((less.at(2).1 - (5.0 / 15.0 - 0.25)).abs() < 1e-15, "{:?}", less.at(2));
}
