//! Segments of one record, each simulated from a guess of its first state, condensed into the record's triangle (lifted
//! Newton: Albersmeyer and Diehl, SIAM J. Optim. 20 (2010) 1655; condensing: Bock and Plitt, 9th IFAC World Congress,
//! 1984).
//!
//! A segment's first state `x` follows the record's unknowns `d` (its own first state, then the parameters) to first order
//! as `x = guess + c + A d`. Where the segment before ends in `end + Phi dx + Psi dp`,
//!
//! ```text
//! A[s+1] = Phi A[s] + [0 | Psi]        c[s+1] = Phi c[s] + end[s] - guess[s+1]
//! ```
//!
//! from `A[0] = [I | 0]`, `c[0] = 0`, and rows `[J_x | J_p | e]` of a segment are rows `J_x A + [0 | J_p]`, `e - J_x c` of
//! the record. For a model that is affine in its state this is exact, whatever the guesses; for another one it is as exact
//! as `c` is small.

use super::{Block, Information};

/// Rows gathered for one absorption.
const ROWS: usize = 64;

/// A segment as simulated from a guess of its first state.
pub(crate) struct Segment<'a> {
    /// Columns: the first state, then the parameters.
    pub triangle: &'a Information,
    /// The first state that was assumed.
    pub guess: &'a [f64],
    /// The state where the segment ends, which is where the next one begins.
    pub end: &'a [f64],
    /// Slopes of `end`, a row for each state, in the columns of the triangle.
    pub slopes: &'a [f64],
}

/// What the segments of a record say together.
pub(crate) struct Condensed {
    /// Columns: the record's first state, then the parameters.
    pub triangle: Information,
    /// The first state of each segment.
    pub borders: Vec<Border>,
    /// `|J_x c|^2`: the part of the sum of squares that is owed to guesses that were not where the segment before ended.
    pub correction: f64,
}

/// How the first state of a segment follows the record's unknowns.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Border {
    /// `guess + c`.
    state: Vec<f64>,
    /// `A`, a row for each state.
    slopes: Vec<f64>,
}

impl Border {
    /// The state after a step of the record's unknowns; missing entries of the step are zero.
    pub fn after(&self, step: &[f64]) -> Vec<f64> {
        let n = self.slopes.len() / self.state.len().max(1);
        let rows = self.slopes.chunks_exact(n.max(1));
        self.state.iter().zip(rows).map(|(state, row)| state + dot(row, step)).collect()
    }
}

/// Condenses the segments of a record, in the order of time, all with the same number of states and of parameters.
pub(crate) fn condense(segments: &[Segment<'_>]) -> Condensed {
    let n = segments.first().map_or(0, |segment| segment.triangle.columns());
    let states = segments.first().map_or(0, |segment| segment.guess.len()).min(n);
    let mut condensed =
        Condensed { triangle: Information::new(n), borders: Vec::with_capacity(segments.len()), correction: 0.0 };
    let mut block = Block::new(n, ROWS);
    let mut rows = 0;
    let (mut a, mut c) = (identity(states, n), vec![0.0; states]);
    for (number, segment) in segments.iter().enumerate() {
        for i in 0..=n {
            let slopes: Vec<f64> = (0..n).map(|j| segment.triangle.at(i, j)).collect();
            let moved = dot(&slopes[..states], &c);
            condensed.correction += moved * moved;
            let row = chained(&slopes, &a, states);
            condensed.triangle.gather(&mut block, &row, segment.triangle.at(i, n) - moved);
        }
        rows += segment.triangle.rows();
        condensed.borders.push(Border {
            state: segment.guess.iter().zip(&c).map(|(guess, c)| guess + c).collect(),
            slopes: a.clone(),
        });
        let Some(next) = segments.get(number + 1) else { break };
        let ends = segment.slopes.chunks_exact(n.max(1));
        let defect = segment.end.iter().zip(next.guess).map(|(end, guess)| end - guess);
        c = ends.clone().zip(defect).map(|(row, defect)| dot(&row[..states], &c) + defect).collect();
        a = ends.flat_map(|row| chained(row, &a, states)).collect();
    }
    condensed.triangle.absorb(&mut block);
    condensed.triangle.rows = rows;
    condensed
}

/// Slopes by a segment's first state and the parameters as slopes by the record's unknowns.
fn chained(row: &[f64], a: &[f64], states: usize) -> Vec<f64> {
    let mut chained: Vec<f64> = row.to_vec();
    chained[..states].fill(0.0);
    for (slope, a) in row[..states].iter().zip(a.chunks_exact(row.len().max(1))) {
        chained.iter_mut().zip(a).for_each(|(to, a)| *to += slope * a);
    }
    chained
}

fn identity(rows: usize, columns: usize) -> Vec<f64> {
    (0..rows * columns).map(|at| f64::from(u8::from(at / columns == at % columns))).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const STATES: usize = 3;
    const PARAMETERS: usize = 2;
    const N: usize = STATES + PARAMETERS;

    /// A state and its slopes.
    #[derive(Clone)]
    struct Carried {
        x: [f64; STATES],
        slopes: [[f64; N]; STATES],
    }

    impl Carried {
        fn at(x: &[f64]) -> Self {
            let row = |i: usize| core::array::from_fn(|j| f64::from(u8::from(i == j)));
            Carried { x: core::array::from_fn(|i| x[i]), slopes: core::array::from_fn(row) }
        }

        /// `x + h (F x + G p + input - bend x1^3)`.
        fn next(&self, k: usize, p: &[f64; PARAMETERS], bend: f64) -> Self {
            const F: [[f64; STATES]; STATES] = [[-0.4, 1.1, 0.0], [-0.9, -0.2, 0.3], [0.2, 0.0, -0.5]];
            const G: [[f64; PARAMETERS]; STATES] = [[0.7, 0.0], [0.0, 1.3], [0.4, -0.6]];
            let (mut next, h) = (self.clone(), 0.05);
            for i in 0..STATES {
                let cubic = if i == 1 { bend * self.x[0].powi(3) } else { 0.0 };
                let flow = dot(&F[i], &self.x) + dot(&G[i], p) + (0.3 * k as f64).sin() - cubic;
                next.x[i] += h * flow;
                for j in 0..N {
                    let cubic = if i == 1 { 3.0 * bend * self.x[0].powi(2) * self.slopes[0][j] } else { 0.0 };
                    let direct = if j < STATES { 0.0 } else { G[i][j - STATES] };
                    let through: f64 = (0..STATES).map(|m| F[i][m] * self.slopes[m][j]).sum();
                    next.slopes[i][j] += h * (through + direct - cubic);
                }
            }
            next
        }
    }

    /// Rows of samples `from..to`: the first and the last state are measured. The triangle and the end.
    fn simulate(x: &[f64], p: &[f64; PARAMETERS], bend: f64, from: usize, to: usize) -> (Information, Carried) {
        let (mut carried, mut triangle) = (Carried::at(x), Information::new(N));
        for k in from..to {
            for i in [0, 2] {
                triangle.absorb_row(&carried.slopes[i], (k as f64).cos() - carried.x[i]);
            }
            carried = carried.next(k, p, bend);
        }
        (triangle, carried)
    }

    const BORDERS: [usize; 5] = [0, 30, 70, 90, 150];

    fn condensed(guesses: &[Vec<f64>], p: &[f64; PARAMETERS], bend: f64) -> Condensed {
        let simulated: Vec<(Information, Carried)> = BORDERS
            .windows(2)
            .zip(guesses)
            .map(|(border, guess)| simulate(guess, p, bend, border[0], border[1]))
            .collect();
        let slopes: Vec<Vec<f64>> = simulated.iter().map(|(_, end)| end.slopes.concat()).collect();
        let segments: Vec<Segment<'_>> = (0..guesses.len())
            .map(|s| Segment {
                triangle: &simulated[s].0,
                guess: &guesses[s],
                end: &simulated[s].1.x,
                slopes: &slopes[s],
            })
            .collect();
        condense(&segments)
    }

    /// Guesses: the record's first state, then far from everything.
    fn far(x0: &[f64]) -> Vec<Vec<f64>> {
        (0..4).map(|s| x0.iter().map(|x| if s == 0 { *x } else { 3.0 - 2.0 * x * s as f64 }).collect()).collect()
    }

    #[test]
    fn an_affine_model_is_condensed_exactly_from_any_guesses() {
        let (x0, p) = (vec![0.3, -0.7, 1.1], [0.8, -0.4]);
        let (whole, _) = simulate(&x0, &p, 0.0, 0, 150);
        let parts = condensed(&far(&x0), &p, 0.0);
        assert_eq!(parts.triangle.rows(), whole.rows());
        assert!(parts.correction > 1.0, "{}", parts.correction);
        for i in 0..=N {
            for j in i..=N {
                let (a, b) = (parts.triangle.at(i, j), whole.at(i, j));
                // Sums of 300 rows of numbers up to ten.
                assert!((a - b).abs() < 1e-12, "{i} {j}: {a} {b}");
            }
        }
        // The borders, before and after a step of the unknowns.
        let step = [0.2, 0.1, -0.3, 0.5, 0.7];
        let moved: Vec<f64> = x0.iter().zip(&step).map(|(x, d)| x + d).collect();
        for (s, border) in parts.borders.iter().enumerate() {
            for (x0, p, step) in [(&x0, p, &[0.0; N]), (&moved, [p[0] + step[3], p[1] + step[4]], &step)] {
                let there = simulate(x0, &p, 0.0, 0, BORDERS[s]).1.x;
                for (found, expected) in border.after(step).iter().zip(there) {
                    assert!((found - expected).abs() < 1e-12, "segment {s}: {found} {expected}");
                }
            }
        }
    }

    /// From borders where the segment before ends, the condensed triangle is that of single shooting; repeated condensing
    /// finds these borders, quadratically.
    #[test]
    fn a_nonlinear_model_is_condensed_exactly_from_its_own_borders() {
        let (x0, p, bend) = (vec![0.3, -0.7, 1.1], [0.8, -0.4], 0.5);
        let (whole, _) = simulate(&x0, &p, bend, 0, 150);
        let mut guesses: Vec<Vec<f64>> =
            BORDERS[..4].iter().map(|&k| simulate(&x0, &p, bend, 0, k).1.x.to_vec()).collect();
        guesses[1..].iter_mut().flatten().for_each(|x| *x += 0.1);
        let mut corrections = vec![];
        for _ in 0..5 {
            let parts = condensed(&guesses, &p, bend);
            corrections.push(parts.correction);
            guesses = parts.borders.iter().map(|border| border.after(&[])).collect();
        }
        let parts = condensed(&guesses, &p, bend);
        assert!(corrections[1] < 0.1 * corrections[0] && parts.correction < 1e-24, "{corrections:?}");
        for (i, j) in (0..=N).flat_map(|i| (i..=N).map(move |j| (i, j))) {
            assert!((parts.triangle.at(i, j) - whole.at(i, j)).abs() < 1e-11, "{i} {j}");
        }
    }

    #[test]
    fn one_segment_is_the_record_and_none_says_nothing() {
        let (x0, p) = (vec![0.3, -0.7, 1.1], [0.8, -0.4]);
        let (triangle, end) = simulate(&x0, &p, 0.5, 0, 20);
        let slopes = end.slopes.concat();
        let parts = condense(&[Segment { triangle: &triangle, guess: &x0, end: &end.x, slopes: &slopes }]);
        for (i, j) in (0..=N).flat_map(|i| (i..=N).map(move |j| (i, j))) {
            assert!((parts.triangle.at(i, j) - triangle.at(i, j)).abs() < 1e-13, "{i} {j}");
        }
        assert_eq!((parts.correction, parts.borders[0].after(&[0.0, 1.0])), (0.0, vec![0.3, 1.0 - 0.7, 1.1]));
        assert_eq!(condense(&[]).triangle, Information::new(0));
    }
}
