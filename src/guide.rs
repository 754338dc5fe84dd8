//! The guide: chapters for engineers who estimate parameters from records.
//!
//! Each chapter is short, runs as it stands on small records, and ends with what it does not do. Numbers in the text are
//! checked by its code.
//!
//! | chapter | |
//! |---|---|
//! | [1](chapter_01_first_fit) | a first fit |
//! | [2](chapter_02_records) | your CSV and log files: units, hold, gaps, alignment |
//! | [3](chapter_03_initial_states) | initial states |
//! | [4](chapter_04_bounds_priors_logarithms) | bounds, priors, logarithms |
//! | [5](chapter_05_noise_weighting_loss) | noise, weighting, loss: which is which |
//! | [6](chapter_06_several_records) | several records, own parameters, fleets |
//! | [7](chapter_07_reading_the_report) | reading the report, sentence by sentence |
//! | [8](chapter_08_colored_residuals) | the residuals are not white: what now |
//! | [9](chapter_09_validation) | validation |
//! | [10](chapter_10_other_minima) | bad starts and other minima |
//! | [11](chapter_11_motor) | a motor from record to Rs, Ls, Ke |
//! | [12](chapter_12_observers) | observers in a drive, without `std` |
//! | [13](chapter_13_extensions) | writing an integrator, a loss, a predictor, a motor |
//! | [14](chapter_14_coming_from) | coming from `idnlgrey`, lmfit, Ceres, CasADi |
//! | [15](chapter_15_how_it_works) | how it works: duals, lanes, the triangle, segments |
//! | [16](chapter_16_text_models) | models as text files |
//! | [17](chapter_17_command) | the command: models and records from a shell |
//! | [18](chapter_18_python) | Python: models, frames, results, options |
//! | [19](chapter_19_clusters) | fleets on Spark, Dask and Ray |
//! | [20](chapter_20_process_noise) | a plant that is disturbed: process noise |

/// A chapter: its text, after the pictures that it names. A picture is a link definition with the image in it, so that the
/// page needs no other file; the chapter's own definitions, which come second, are for readers of the files.
macro_rules! chapter {
    ($name:ident, $file:literal $(, $picture:literal)*) => {
        $(#[doc = include_str!(concat!("../docs/guide/pictures/", $picture, ".md"))])*
        #[doc = include_str!(concat!("../docs/guide/", $file, ".md"))]
        pub mod $name {}
    };
}

chapter!(chapter_01_first_fit, "01_first_fit", "rotor");
chapter!(chapter_02_records, "02_records", "half_sample");
chapter!(chapter_03_initial_states, "03_initial_states");
chapter!(chapter_04_bounds_priors_logarithms, "04_bounds_priors_logarithms");
chapter!(chapter_05_noise_weighting_loss, "05_noise_weighting_loss");
chapter!(chapter_06_several_records, "06_several_records");
chapter!(chapter_07_reading_the_report, "07_reading_the_report", "parameters", "profile");
chapter!(chapter_08_colored_residuals, "08_colored_residuals", "colored");
chapter!(chapter_09_validation, "09_validation", "validation");
chapter!(chapter_10_other_minima, "10_other_minima", "waterfall");
chapter!(chapter_11_motor, "11_motor");
chapter!(chapter_12_observers, "12_observers");
chapter!(chapter_13_extensions, "13_extensions");
chapter!(chapter_14_coming_from, "14_coming_from");
chapter!(chapter_15_how_it_works, "15_how_it_works");
#[cfg(feature = "text")]
chapter!(chapter_16_text_models, "16_text_models");
chapter!(chapter_17_command, "17_command");
chapter!(chapter_18_python, "18_python");
chapter!(chapter_19_clusters, "19_clusters");
chapter!(chapter_20_process_noise, "20_process_noise");
