#![cfg(feature = "std")]
//! Linear least squares against certified numbers, identities, and the scatter of repeated experiments.
use greybox::{
    Signals,
    regress::{Assumption, LinearEstimate, PooledRegression, Regression, RegressionError},
    signals,
};

signals! {
    /// Parameters of the tests.
    struct Three { a: "ohm", b: "H", c: "V s/rad" }
}
signals! {
    /// Longley's regression.
    struct Longley { b0: "1", b1: "1", b2: "1", b3: "1", b4: "1", b5: "1", b6: "1" }
}
signals! {
    /// One constant.
    struct Mean { mean: "V" }
}

/// Uniform numbers in 0..1 and Gaussian ones, the same on every run.
struct Noise(u64);
impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        let mixed = (self.0 ^ (self.0 >> 29)).wrapping_mul(0xbf58476d1ce4e5b9);
        ((mixed >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }
    fn gauss(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (core::f64::consts::TAU * self.uniform()).cos()
    }
}

#[track_caller]
fn assert_close(a: f64, b: f64, relative: f64) {
    assert!((a - b).abs() <= relative * b.abs(), "{a} {b}");
}

#[test]
fn longley_as_certified_by_nist() {
    // NIST StRD, Longley: employment by price deflator, GNP, unemployment, armed forces, population and year.
    let data = [
        [60323.0, 83.0, 234289.0, 2356.0, 1590.0, 107608.0, 1947.0],
        [61122.0, 88.5, 259426.0, 2325.0, 1456.0, 108632.0, 1948.0],
        [60171.0, 88.2, 258054.0, 3682.0, 1616.0, 109773.0, 1949.0],
        [61187.0, 89.5, 284599.0, 3351.0, 1650.0, 110929.0, 1950.0],
        [63221.0, 96.2, 328975.0, 2099.0, 3099.0, 112075.0, 1951.0],
        [63639.0, 98.1, 346999.0, 1932.0, 3594.0, 113270.0, 1952.0],
        [64989.0, 99.0, 365385.0, 1870.0, 3547.0, 115094.0, 1953.0],
        [63761.0, 100.0, 363112.0, 3578.0, 3350.0, 116219.0, 1954.0],
        [66019.0, 101.2, 397469.0, 2904.0, 3048.0, 117388.0, 1955.0],
        [67857.0, 104.6, 419180.0, 2822.0, 2857.0, 118734.0, 1956.0],
        [68169.0, 108.4, 442769.0, 2936.0, 2798.0, 120445.0, 1957.0],
        [66513.0, 110.8, 444546.0, 4681.0, 2637.0, 121950.0, 1958.0],
        [68655.0, 112.6, 482704.0, 3813.0, 2552.0, 123366.0, 1959.0],
        [69564.0, 114.2, 502601.0, 3931.0, 2514.0, 125368.0, 1960.0],
        [69331.0, 115.7, 518173.0, 4806.0, 2572.0, 127852.0, 1961.0],
        [70551.0, 116.9, 554894.0, 4007.0, 2827.0, 130081.0, 1962.0],
    ];
    let certified = [
        (-3482258.63459582, 890420.383607373),
        (15.0618722713733, 84.9149257747669),
        (-0.358191792925910e-01, 0.334910077722432e-01),
        (-2.02022980381683, 0.488399681651699),
        (-1.03322686717359, 0.214274163161675),
        (-0.511041056535807e-01, 0.226073200069370),
        (1829.15146461355, 455.478499142212),
    ];
    let mut regression = Regression::<Longley>::new();
    for [y, x @ ..] in data {
        regression.row([1.0, x[0], x[1], x[2], x[3], x[4], x[5]].into(), y);
    }
    let estimate = regression.solve().unwrap();
    let (values, errors): ([f64; 7], [f64; 7]) = (estimate.parameters.into(), estimate.standard_errors.into());
    for (i, (value, error)) in certified.into_iter().enumerate() {
        // The scaled columns have condition 43,000 (Belsley, Kuh and Welsch): rounding moves the solution by 1e-11.
        assert_close(values[i], value, 1e-10);
        assert_close(errors[i], error, 1e-10);
    }
    assert_close(estimate.condition, 43275.0, 1e-4);
    assert_close(estimate.rms * (16.0f64 / 9.0).sqrt(), 304.854073561965, 1e-10);
    assert_eq!((estimate.rows, estimate.assumption), (16, Assumption::EqualVariance));
}

fn rows(count: usize, seed: u64) -> Vec<([f64; 3], f64)> {
    let mut noise = Noise(seed);
    (0..count)
        .map(|_| {
            let phi = [noise.gauss(), noise.gauss() * 30.0 + 4.0, noise.gauss() * 0.01 + 0.02];
            (phi, phi[0] * 2.0 - phi[1] * 0.3 + phi[2] * 50.0 + noise.gauss() * 0.1)
        })
        .collect()
}

fn weight(row: usize) -> f64 {
    0.2 + (row % 7) as f64
}

fn regression(rows: &[([f64; 3], f64)], weighted: bool) -> Regression<Three> {
    let mut regression = Regression::new();
    for (k, &(phi, y)) in rows.iter().enumerate() {
        regression.weighted_row(phi.into(), y, if weighted { weight(k) } else { 1.0 });
    }
    regression
}

#[test]
fn the_index_is_the_change_that_doubles_the_squared_residual() {
    let rows = rows(400, 1);
    for weighted in [false, true] {
        let estimate = regression(&rows, weighted).solve().unwrap();
        let least = regression(&rows, weighted).information().residual();
        let theta: [f64; 3] = estimate.parameters.into();
        let (index, held): ([f64; 3], [f64; 3]) = (estimate.index.into(), estimate.index_others_held.into());
        for i in 0..3 {
            for sign in [-1.0, 1.0] {
                // The others refitted: what is left of y is explained by the other columns alone.
                let moved = theta[i] * (1.0 + sign * index[i] / 100.0);
                let left: Vec<_> = rows.iter().map(|&(phi, y)| (phi, y - phi[i] * moved)).collect();
                let others: Vec<usize> = (0..3).filter(|&j| j != i).collect();
                let refitted = regression(&left, weighted).information().select(&others).residual();
                assert!((refitted / least - 2.0).abs() < 1e-6, "{}", refitted / least);

                let mut parameters = theta;
                parameters[i] *= 1.0 + sign * held[i] / 100.0;
                let residuals = regression(&rows, weighted);
                let changed: f64 = residuals
                    .residuals(parameters.into())
                    .enumerate()
                    .map(|(k, e)| e * e * if weighted { weight(k) } else { 1.0 })
                    .sum();
                assert!((changed / least - 2.0).abs() < 1e-6, "{}", changed / least);
            }
            assert!(held[i] <= index[i]);
        }
        if !weighted {
            // Section 5: the index equals sqrt(rows - parameters) standard errors.
            let errors: [f64; 3] = estimate.standard_errors.into();
            for i in 0..3 {
                assert_close(index[i], 100.0 * 397f64.sqrt() * errors[i] / theta[i].abs(), 1e-12);
            }
        }
    }
}

#[test]
fn only_the_course_of_the_weights_matters() {
    let rows = rows(100, 2);
    let plain = regression(&rows, false).solve().unwrap();
    let (mut scaled, mut with_zero) = (Regression::<Three>::new(), regression(&rows, false));
    for &(phi, y) in &rows {
        scaled.weighted_row(phi.into(), y, 1e9);
        with_zero.weighted_row(phi.into(), 1e6, 0.0);
    }
    let (scaled, with_zero) = (scaled.solve().unwrap(), with_zero.solve().unwrap());
    assert_eq!((scaled.assumption, with_zero.assumption), (Assumption::EqualVariance, Assumption::EqualVariance));
    assert_eq!((scaled.rows, with_zero.rows), (100, 100));
    for other in [scaled, with_zero] {
        approx::assert_relative_eq!(other.parameters, plain.parameters, max_relative = 1e-12);
        approx::assert_relative_eq!(other.standard_errors, plain.standard_errors, max_relative = 1e-12);
        approx::assert_relative_eq!(other.index, plain.index, max_relative = 1e-12);
        assert_close(other.rms, plain.rms, 1e-12);
    }
}

#[test]
fn the_sandwich_of_a_weighted_mean() {
    // One column of ones: the estimate is the weighted mean, a row's leverage its share of the weights w / sum w, the
    // sandwich sum (w e / (1 - leverage))^2 / (sum w)^2.
    let data = [(1.0, 2.0), (2.0, 1.0), (4.0, 0.5), (7.0, 3.0), (3.0, 1.0)];
    let mut regression = Regression::<Mean>::new();
    data.iter().for_each(|&(y, w)| regression.weighted_row(Mean { mean: 1.0 }, y, w));
    let total: f64 = data.iter().map(|(_, w)| w).sum();
    let mean = data.iter().map(|(y, w)| y * w).sum::<f64>() / total;
    let scores: Vec<f64> = data.iter().map(|(y, w)| w * (y - mean) / (1.0 - w / total)).collect();
    let squares: f64 = scores.iter().map(|s| s * s).sum();
    let estimate = regression.solve().unwrap();
    assert_eq!(estimate.assumption, Assumption::OwnVariance);
    assert_close(estimate.parameters.mean, mean, 1e-14);
    assert_close(estimate.standard_errors.mean, squares.sqrt() / total, 1e-14);

    // Correlated over one lag: products of neighbors count by half, twice.
    let neighbors: f64 = scores.windows(2).map(|s| s[0] * s[1]).sum();
    let estimate = regression.correlated(1).solve().unwrap();
    assert_close(estimate.standard_errors.mean, (squares + neighbors).sqrt() / total, 1e-13);
    assert_eq!(estimate.assumption, Assumption::Correlated { lags: 1 });
}

#[test]
fn intervals_cover_as_often_as_they_say() {
    // 4,000 experiments: three standard deviations of the count are 1 %.
    let mut noise = Noise(3);
    let runs = 4000;
    let mut hits = [[0; 3]; 3];
    for _ in 0..runs {
        let (mut equal, mut weighted, mut uneven) =
            (Regression::<Three>::new(), Regression::<Three>::new(), Regression::<Three>::new());
        for k in 0..200 {
            let phi = [1.0, noise.gauss(), (k as f64 * 0.3).sin()];
            let (exact, e) = (phi[0] - phi[1] * 2.0 + phi[2] * 0.5, noise.gauss());
            equal.row(phi.into(), exact + e);
            weighted.weighted_row(phi.into(), exact + e, weight(k));
            // Noise that grows with the weight: the worst case for a weight taken as an inverse variance.
            uneven.weighted_row(phi.into(), exact + e * weight(k), weight(k));
        }
        for (hits, regression) in hits.iter_mut().zip([equal, weighted, uneven]) {
            let intervals: [[f64; 2]; 3] = regression.solve().unwrap().intervals(0.95).into();
            for ((hits, [low, high]), truth) in hits.iter_mut().zip(intervals).zip([1.0, -2.0, 0.5]) {
                *hits += usize::from(low <= truth && truth <= high);
            }
        }
    }
    for hits in hits.as_flattened() {
        let cover = *hits as f64 / runs as f64;
        assert!((0.94..=0.96).contains(&cover), "{hits:?}");
    }
}

#[test]
fn filtered_residuals_widen_the_standard_error() {
    // White noise through a moving average of 39 rows: the mean is as uncertain as before, but the rows' variance is a
    // 39th, so an assumption of independence is sqrt(39) = 6.2 times too narrow.
    let (rows, m, lags) = (400_000, 39, 400);
    let mut noise = Noise(4);
    let white: Vec<f64> = (0..rows + m).map(|_| noise.gauss()).collect();
    let mut regression = Regression::<Mean>::new();
    for k in 0..rows {
        regression.row(Mean { mean: 1.0 }, white[k..k + m].iter().sum::<f64>() / m as f64);
    }
    let blind = regression.solve().unwrap().standard_errors.mean;
    let seeing = regression.correlated(lags).solve().unwrap().standard_errors.mean;
    let truth = 1.0 / (rows as f64).sqrt();
    assert_close(truth / blind, (m as f64).sqrt(), 0.03);
    // Bartlett's weights leave out a little: sum over lags of (1 - l/401) (1 - l/39) / 39.
    let left = |l: i64| (1.0 - l.abs() as f64 / (lags + 1) as f64) * (1.0 - l.abs() as f64 / m as f64) / m as f64;
    let expected = (1 - m as i64..m as i64).map(left).sum::<f64>().sqrt();
    // The variance itself scatters by sqrt(4 lags / (3 rows)) = 3.7 %: half of that here, times three.
    assert_close(seeing / truth, expected, 0.055);
}

#[test]
fn what_cannot_be_known_is_named() {
    // b and c enter as b + 1000 c only; a not at all.
    let mut regression = Regression::<Three>::new();
    let mut noise = Noise(5);
    for _ in 0..50 {
        let x = noise.gauss();
        regression.row(Three { a: 0.0, b: x, c: 1000.0 * x }, x);
    }
    let error = regression.solve().unwrap_err();
    let RegressionError::NotIdentifiable { directions } = &error else { panic!("{error}") };
    assert_eq!(directions.len(), 2);
    assert!(directions.iter().any(|d| *d == [("a", 1.0)]));
    let both = directions.iter().find(|d| d.len() == 2).unwrap();
    let change = |name| both.iter().find(|(n, _)| *n == name).unwrap().1;
    assert_close(change("b") / change("c"), -1000.0, 1e-12);
    let text = error.to_string();
    assert!(text.contains("`a` is not identifiable, its column is zero"), "{text}");
    assert!(text.contains("known only in combination"), "{text}");

    // Scales apart by 1e24 do not hide it, and do not fake it.
    for (scale, dependent) in [(1e12, true), (1e12, false)] {
        let mut regression = Regression::<Three>::new();
        for _ in 0..50 {
            let (x, y, z) = (noise.gauss(), noise.gauss(), noise.gauss());
            let third = if dependent { x + y } else { z };
            regression.row(Three { a: x * scale, b: y / scale, c: third }, x);
        }
        match regression.solve() {
            Ok(_) => assert!(!dependent),
            Err(RegressionError::NotIdentifiable { directions }) => {
                assert!(dependent);
                assert_eq!((directions.len(), directions[0].len()), (1, 3));
            }
            Err(other) => panic!("{other}"),
        }
    }
}

#[test]
fn bad_rows_are_refused_by_name() {
    let good = rows(10, 6);
    let with = |phi: [f64; 3], y: f64, weight: f64| {
        let mut regression = regression(&good, false);
        regression.weighted_row(phi.into(), y, weight);
        regression.solve().unwrap_err().to_string()
    };
    assert!(with([1.0, f64::NAN, 1.0], 0.0, 1.0).starts_with("row 10: `b` is NaN"));
    assert!(with([1.0; 3], f64::INFINITY, 1.0).starts_with("row 10: `y` is inf"));
    assert!(with([1.0; 3], 0.0, f64::NAN).starts_with("row 10: `weight` is NaN"));
    assert!(with([1.0; 3], 0.0, -2.0).starts_with("row 10: the weight is -2"));
    let tiny: Vec<_> = good.iter().map(|&([a, b, c], y)| ([a * 1e-200, b, c], y)).collect();
    assert_eq!(regression(&tiny, false).solve().unwrap_err(), RegressionError::OutOfRange);
    for count in 0..4 {
        let error = regression(&good[..count], false).solve().unwrap_err();
        assert_eq!(error, RegressionError::TooFewRows { rows: count, parameters: 3 });
    }
    assert!(regression(&good[..4], true).solve().is_ok());
}

#[test]
fn an_exact_record_is_known_exactly() {
    let mut regression = Regression::<Three>::new();
    for k in 0..20i32 {
        let (x, z) = (f64::from(k % 3 - 1), f64::from(k % 4));
        regression.row(Three { a: x, b: z, c: 1.0 }, 0.0);
    }
    let estimate = regression.solve().unwrap();
    assert_eq!(estimate.parameters, Three::default());
    assert_eq!(estimate.standard_errors, Three::default());
    assert_eq!(estimate.index, Three::default());
    assert_eq!(estimate.correlation()[(0, 1)], 0.0);
}

#[test]
fn an_estimate_prints_and_comes_back() {
    let estimate = regression(&rows(50, 7), true).solve().unwrap();
    let text = estimate.to_string();
    for word in Three::<f64>::NAMES.iter().chain(Three::<f64>::UNITS).chain(&["50 rows", "own variance"]) {
        assert!(text.contains(word), "{text}");
    }
    let back: LinearEstimate<Three> = serde_json::from_str(&serde_json::to_string(&estimate).unwrap()).unwrap();
    assert_eq!(format!("{back:?}"), format!("{estimate:?}"));
    let correlation = estimate.correlation();
    for (i, j) in [(0, 1), (1, 2), (0, 2)] {
        assert!(correlation[(i, j)].abs() <= 1.0 && correlation[(i, j)] == correlation[(j, i)]);
    }
    assert_eq!(estimate.intervals(1.0).a, [f64::NEG_INFINITY, f64::INFINITY]);
}

signals! {
    /// A line of its own offset for each of two sets, all in one vector.
    struct TwoLines { slope: "V/s", first: "V", second: "V" }
}
signals! {
    /// The same line, seen by one set.
    struct OneLine { slope: "V/s", offset: "V" }
}

/// Two sets of a noisy line as one regression with an offset column for each, and as two sets.
fn two_lines(weight: impl Fn(f64) -> f64) -> (Regression<TwoLines>, [Regression<OneLine>; 2]) {
    let (mut noise, mut whole, mut sets) = (Noise(7), Regression::new(), [Regression::new(), Regression::new()]);
    for k in 0..240 {
        let (t, second) = (f64::from(k) / 50.0, k % 3 == 0);
        let y = 2.0 * t + if second { -1.0 } else { 0.5 } + 0.1 * noise.gauss();
        let (first_column, second_column) = if second { (0.0, 1.0) } else { (1.0, 0.0) };
        whole.weighted_row([t, first_column, second_column].into(), y, weight(t));
        sets[usize::from(second)].weighted_row(OneLine { slope: t, offset: 1.0 }, y, weight(t));
    }
    (whole, sets)
}

// The pooled solution is that of one regression in which each set has its own column; without lags every number agrees
// to rounding.
#[test]
fn pooled_sets_are_one_regression_with_own_columns() {
    for weight in [|_: f64| 1.0, |t: f64| 0.5 + t] {
        let (whole, sets) = two_lines(weight);
        let pooled = PooledRegression::new(sets, OneLine { slope: true, offset: false });
        let (whole_found, found) = (whole.solve().unwrap(), pooled.solve().unwrap());
        assert_close(pooled.least_squares(), whole.information().residual(), 1e-12);
        let (p, s) = (whole_found.parameters, whole_found.standard_errors);
        let (x, h) = (whole_found.index, whole_found.index_others_held);
        for (set, of) in
            found.iter().zip([[(p.first, s.first, x.first, h.first)], [(p.second, s.second, x.second, h.second)]])
        {
            let own =
                (set.parameters.offset, set.standard_errors.offset, set.index.offset, set.index_others_held.offset);
            let shared =
                (set.parameters.slope, set.standard_errors.slope, set.index.slope, set.index_others_held.slope);
            for (a, b) in [(own, of[0]), (shared, (p.slope, s.slope, x.slope, h.slope))] {
                assert_close(a.0, b.0, 1e-11);
                assert_close(a.1, b.1, 1e-11);
                assert_close(a.2, b.2, 1e-10);
                assert_close(a.3, b.3, 1e-10);
            }
            assert_eq!(set.assumption, whole_found.assumption);
        }
    }
}

// With nothing in common each set is solved by itself, correlation over lags included; only the noise of equal variance is
// that of all sets.
#[test]
fn sets_with_nothing_in_common_are_solved_one_by_one() {
    let (_, sets) = two_lines(|_| 1.0);
    let sets = sets.map(|set| set.correlated(4));
    let found = PooledRegression::new(sets.clone(), OneLine { slope: false, offset: false }).solve().unwrap();
    for (set, found) in sets.iter().zip(found) {
        let alone = set.solve().unwrap();
        assert_close(found.parameters.slope, alone.parameters.slope, 1e-12);
        assert_close(found.standard_errors.slope, alone.standard_errors.slope, 1e-10);
        assert_close(found.standard_errors.offset, alone.standard_errors.offset, 1e-10);
        assert_close(found.rms, alone.rms, 1e-12);
    }
}

/// Rows of a line in two records: errors that both have, of standard deviation `common`, and errors of their own, of 0.1.
fn two_records(noise: &mut Noise, common: f64) -> [Regression<OneLine>; 2] {
    let mut sets = [Regression::new(), Regression::new()];
    for k in 0..200 {
        let t = f64::from(k) / 200.0;
        let of_both = common * noise.gauss();
        for (set, slope) in sets.iter_mut().zip([1.0, 1.5]) {
            set.row(OneLine { slope: t, offset: 1.0 }, slope * t + of_both + 0.1 * noise.gauss());
        }
    }
    sets
}

// Errors that repeat cancel in the difference: 400 pairs of records scatter as is said, 3.5 % being the standard deviation of
// a scatter found from so many. The two standard errors taken together are seven times as large where the errors of both are ten
// times their own; where nothing repeats they are the same.
#[test]
fn a_change_is_known_better_than_its_ends_where_errors_repeat() {
    let mut noise = Noise(11);
    for (common, ratio) in [(1.0, 0.0995), (0.0, 1.0)] {
        let (mut squares, mut said, mut apart) = (0.0, 0.0, 0.0);
        for _ in 0..400 {
            let [before, after] = two_records(&mut noise, common);
            let change = before.change(&after).unwrap();
            let ends = [before, after].map(|set| set.solve().unwrap());
            assert_close(change.parameters.slope, ends[1].parameters.slope - ends[0].parameters.slope, 1e-12);
            squares += (change.parameters.slope - 0.5).powi(2);
            said += change.standard_errors.slope.powi(2);
            apart += ends.map(|e| e.standard_errors.slope.powi(2)).iter().sum::<f64>();
            assert_close(change.covariance[(0, 0)].sqrt(), change.standard_errors.slope, 1e-14);
        }
        assert!(((squares / said).sqrt() - 1.0).abs() < 0.12, "{common}: {squares} {said}");
        assert_close((said / apart).sqrt(), ratio, 0.03);
    }
}

// By hand for means: a change of means has the variance of the sum of the differences of the errors; with one lag by Newey and
// West half of the products of neighbors count twice.
#[test]
fn a_change_of_means_by_hand() {
    let set = |values: [f64; 4]| {
        let mut rows = Regression::<Mean>::new();
        values.iter().for_each(|y| rows.row(Mean { mean: 1.0 }, *y));
        rows
    };
    let (before, after) = (set([1.0, 2.0, 4.0, 1.0]), set([3.0, 3.0, 7.0, 3.0]));
    let change = before.change(&after).unwrap();
    assert_close(change.parameters.mean, 2.0, 1e-14);
    // Differences of the errors (0, -1, 1, 0), over one less the leverage of a quarter, over four rows.
    assert_close(change.standard_errors.mean, 2f64.sqrt() / 0.75 / 4.0, 1e-12);
    // Half of a product of -1, twice.
    let correlated = before.clone().correlated(1).change(&after).unwrap();
    assert_close(correlated.standard_errors.mean, 1.0 / 0.75 / 4.0, 1e-12);
    let mut shorter = Regression::<Mean>::new();
    (0..3).for_each(|k| shorter.row(Mean { mean: 1.0 }, f64::from(k)));
    let error = before.change(&shorter).unwrap_err();
    assert_eq!(error, RegressionError::NotPaired { rows: 4, later: 3 });
    let mut left_out = after.clone();
    left_out.weighted_row(Mean { mean: 1.0 }, 9.0, 0.0);
    assert!(before.change(&left_out).unwrap_err().to_string().contains("do not go together"));
}

#[test]
fn pooled_sets_that_do_not_determine_a_parameter_name_it() {
    let mut still = Regression::<OneLine>::new();
    (0..5).for_each(|_| still.row(OneLine { slope: 0.0, offset: 1.0 }, 1.0));
    let shared = OneLine { slope: true, offset: false };
    let error = PooledRegression::new([still.clone(), still], shared).solve().unwrap_err().to_string();
    assert!(error.contains("`slope` is not identifiable"), "{error}");
    let none = PooledRegression::<OneLine>::new([], shared).solve().unwrap_err().to_string();
    assert!(none.contains("0 row(s)"), "{none}");
}
