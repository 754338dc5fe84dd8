//! [`Chain`]: segments of a record, each from an initial value of its own, as one triangle of the record's unknowns.

use super::{Block, Information};

/// Eliminates the initial values of a record's segments by what the segments before say of them.
///
/// A segment was simulated from a guess of its initial value, with slopes of its rows and of its end with respect to that
/// value and to the parameters. With `x[s] = guess[s] + defect[s] + S[s] d` for changes `d` of the record's unknowns, the end of
/// one segment is the begin of the next: `S[s + 1] = Phi S[s] + Psi P`, `defect[s + 1] = end[s] + Phi defect[s] - guess[s + 1]`
/// (condensing of multiple shooting: H. G. Bock and K. J. Plitt, IFAC Proceedings 17 (1984) 1603). For models that are affine in
/// their initial values the result is exact whatever the guesses; for others the guesses must be the simulated values.
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
    information: Information,
    rows: u64,
    /// Sum of squares of what the defects changed.
    pub moved: f64,
    /// Sum of squares of all errors.
    pub squares: f64,
}

impl<'c> Chain<'c> {
    /// From the slopes of the first segment's initial value with respect to the unknowns, row by row.
    pub fn new(carried: usize, slopes: Vec<f64>, parameters: &'c [usize], scales: &'c [f64]) -> Self {
        let information = Information::new(scales.len());
        let defect = vec![0.0; carried];
        Chain { carried, parameters, scales, slopes, defect, information, rows: 0, moved: 0.0, squares: 0.0 }
    }

    /// What is known of the initial value that the next segment has: by how much its guess is off, and its slopes.
    pub fn begin(&self) -> (&[f64], &[f64]) {
        (&self.defect, &self.slopes)
    }

    /// Takes in the triangle of the next segment, its columns the initial value and then the parameters.
    pub fn add(&mut self, segment: &Information) {
        let (n, c, m) = (self.scales.len(), self.carried, self.parameters.len());
        let mut block = Block::new(n, c + m + 1);
        let mut row = vec![0.0; n];
        for i in 0..=c + m {
            let (y, slopes) = segment.row(i);
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
            self.information.gather(&mut block, &row, y - moved);
        }
        self.information.absorb(&mut block);
        self.rows += segment.rows();
    }

    /// On to the next segment: where the one before ended, its slopes there with respect to its initial value and the
    /// parameters, row by row, and the guess from which the next one was simulated.
    pub fn go_on(&mut self, end: &[f64], slopes: &[f64], guess: &[f64]) {
        let (n, c, m) = (self.scales.len(), self.carried, self.parameters.len());
        let before = (std::mem::take(&mut self.slopes), std::mem::take(&mut self.defect));
        (self.slopes, self.defect) = (vec![0.0; c * n], vec![0.0; c]);
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
        self.information.rows = self.rows;
        self.information
    }
}
