//! [`Chain`]: segments of a record, each from an initial value of its own, as one triangle of the record's unknowns.

use super::{Block, Information};

/// Most rows of segments that are absorbed together.
const ROWS: usize = 64;

/// Eliminates the initial values of a record's segments by what the segments before say of them.
///
/// A segment was simulated from a guess of its initial value, with slopes of its rows and of its end with respect to that
/// value and to the parameters. With `x[s] = guess[s] + defect[s] + S[s] d` for changes `d` of the record's unknowns, the end of
/// one segment is the begin of the next: `S[s + 1] = Phi S[s] + Psi P`, `defect[s + 1] = end[s] + Phi defect[s] - guess[s + 1]`
/// (condensing of multiple shooting: H. G. Bock and K. J. Plitt, IFAC Proceedings 17 (1984) 1603). For models that are affine in
/// their initial values the result is exact whatever the guesses; for others to the first order of what the guesses are off.
#[derive(Debug)]
pub(crate) struct Chain<'c> {
    /// Entries of an initial value.
    carried: usize,
    /// The unknown behind each parameter that the segments have slopes for.
    parameters: &'c [usize],
    /// How fast the quantity of each unknown moves with its coordinate.
    scales: &'c [f64],
    /// `S` by rows, with respect to the quantities of the unknowns.
    slopes: Vec<f64>,
    defect: Vec<f64>,
    /// Both of the segment before.
    before: (Vec<f64>, Vec<f64>),
    information: Information,
    /// Rows of segments that are not in the triangle yet, and one of them.
    block: Block,
    row: Vec<f64>,
    rows: u64,
    /// Sum of squares of what the defects changed.
    pub moved: f64,
    /// Sum of squares of all errors.
    pub squares: f64,
}

impl<'c> Chain<'c> {
    /// For so many segments, from the slopes of the first one's initial value with respect to the unknowns, row by row.
    pub fn new(carried: usize, segments: usize, slopes: Vec<f64>, parameters: &'c [usize], scales: &'c [f64]) -> Self {
        let (n, information) = (scales.len(), Information::new(scales.len()));
        let rows = carried + parameters.len() + 1;
        let (block, row) = (Block::new(n, ROWS.min(segments * rows).max(rows)), vec![0.0; n]);
        let defect = vec![0.0; carried];
        let before = (vec![0.0; slopes.len()], defect.clone());
        let (moved, squares) = (0.0, 0.0);
        Chain { carried, parameters, scales, slopes, defect, before, information, block, row, rows: 0, moved, squares }
    }

    /// The information on the initial value of the next segment: by how much its guess is off, and its slopes.
    pub fn begin(&self) -> (&[f64], &[f64]) {
        (&self.defect, &self.slopes)
    }

    /// Takes in the triangle of the next segment, its columns the initial value and then the parameters.
    pub fn add(&mut self, segment: &Information) {
        let (n, c, m) = (self.scales.len(), self.carried, self.parameters.len());
        for i in 0..=c + m {
            let (row, (y, slopes)) = (&mut self.row, segment.row(i));
            row.fill(0.0);
            let mut moved = 0.0;
            for (at, slope) in (i..c + m).zip(slopes) {
                match at.checked_sub(c) {
                    None => {
                        moved += slope * self.defect[at];
                        let of = &self.slopes[at * n..][..n];
                        row.iter_mut().zip(of).for_each(|(row, s)| *row += slope * s);
                    }
                    Some(parameter) => row[self.parameters[parameter]] += slope,
                }
            }
            row.iter_mut().zip(self.scales).for_each(|(row, scale)| *row *= scale);
            self.moved += moved * moved;
            self.squares += (y - moved) * (y - moved);
            self.information.gather(&mut self.block, row, y - moved);
        }
        self.rows += segment.rows();
    }

    /// On to the next segment: where the one before ended, its slopes there with respect to its initial value and the
    /// parameters, row by row, and the guess from which the next one was simulated.
    pub fn go_on(&mut self, end: &[f64], slopes: &[f64], guess: &[f64]) {
        let (n, c, m) = (self.scales.len(), self.carried, self.parameters.len());
        std::mem::swap(&mut self.slopes, &mut self.before.0);
        std::mem::swap(&mut self.defect, &mut self.before.1);
        let before = &self.before;
        self.slopes.fill(0.0);
        for i in 0..c {
            let (phi, psi) = slopes[i * (c + m)..][..c + m].split_at(c);
            let to = &mut self.slopes[i * n..][..n];
            for (j, phi) in phi.iter().enumerate().filter(|(_, phi)| **phi != 0.0) {
                to.iter_mut().zip(&before.0[j * n..]).for_each(|(to, s)| *to += phi * s);
            }
            psi.iter().zip(self.parameters).for_each(|(psi, &unknown)| to[unknown] += psi);
            self.defect[i] = end[i] - guess[i] + phi.iter().zip(&before.1).map(|(phi, d)| phi * d).sum::<f64>();
        }
    }

    /// As if the guess of the segment to come had been right.
    pub fn without_defect(&mut self) {
        self.defect.fill(0.0);
    }

    /// The triangle of the record's unknowns.
    pub fn triangle(mut self) -> Information {
        self.information.absorb(&mut self.block);
        self.information.rows = self.rows;
        self.information
    }
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

    struct Condensed {
        triangle: Information,
        /// Where each segment ought to begin, and its slopes there.
        borders: Vec<(Vec<f64>, Vec<f64>)>,
        moved: f64,
        squares: f64,
    }

    fn condensed(guesses: &[Vec<f64>], p: &[f64; PARAMETERS], bend: f64) -> Condensed {
        let identity = (0..STATES * N).map(|at| f64::from(u8::from(at / N == at % N))).collect();
        let mut chain = Chain::new(STATES, 4, identity, &[3, 4], &[1.0; N]);
        let mut borders = vec![];
        for (s, border) in BORDERS.windows(2).enumerate() {
            let (triangle, end) = simulate(&guesses[s], p, bend, border[0], border[1]);
            let (defect, slopes) = chain.begin();
            borders.push((guesses[s].iter().zip(defect).map(|(x, d)| x + d).collect(), slopes.to_vec()));
            chain.add(&triangle);
            if let Some(guess) = guesses.get(s + 1) {
                chain.go_on(&end.x, &end.slopes.concat(), guess);
            }
        }
        let (moved, squares) = (chain.moved, chain.squares);
        Condensed { triangle: chain.triangle(), borders, moved, squares }
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
        assert!(parts.moved > 1.0, "{}", parts.moved);
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
        let sum_of_squares = whole.residual_at_zero();
        assert!((parts.squares - sum_of_squares).abs() < 1e-13 * sum_of_squares);
        for (s, (begin, slopes)) in parts.borders.iter().enumerate() {
            for (x0, p, step) in [(&x0, p, &[0.0; N]), (&moved, [p[0] + step[3], p[1] + step[4]], &step)] {
                let there = simulate(x0, &p, 0.0, 0, BORDERS[s]).1.x;
                for (i, expected) in there.into_iter().enumerate() {
                    let found = begin[i] + dot(&slopes[i * N..][..N], step);
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
            corrections.push(parts.moved);
            guesses = parts.borders.into_iter().map(|(begin, _)| begin).collect();
        }
        let parts = condensed(&guesses, &p, bend);
        assert!(corrections[1] < 0.1 * corrections[0] && parts.moved < 1e-24, "{corrections:?}");
        for (i, j) in (0..=N).flat_map(|i| (i..=N).map(move |j| (i, j))) {
            assert!((parts.triangle.at(i, j) - whole.at(i, j)).abs() < 1e-11, "{i} {j}");
        }
    }

    /// Unknowns of a record in another order, of which one does not touch the initial value, in other units.
    #[test]
    fn unknowns_stand_where_they_belong() {
        let (x0, p) = (vec![0.3, -0.7, 1.1], [0.8, -0.4]);
        let (triangle, _) = simulate(&x0, &p, 0.5, 0, 20);
        // Unknowns: p[1], x0[2], p[0]; the other two initial values are fixed.
        let slopes = vec![0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let mut chain = Chain::new(STATES, 1, slopes, &[2, 0], &[2.0, 3.0, 5.0]);
        chain.add(&triangle);
        let found = chain.triangle();
        let product =
            |t: &Information, i: usize, j: usize| (0..=i.min(j)).map(|r| t.at(r, i) * t.at(r, j)).sum::<f64>();
        let (from, scales) = ([4, 2, 3, 5], [2.0, 3.0, 5.0, 1.0]);
        for (i, j) in (0..4).flat_map(|i| (0..4).map(move |j| (i, j))) {
            let expected = product(&triangle, from[i], from[j]) * scales[i] * scales[j];
            assert!((product(&found, i, j) - expected).abs() < 1e-12 * expected.abs().max(1.0), "{i} {j}");
        }
    }

    fn dot(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| a * b).sum()
    }
}
