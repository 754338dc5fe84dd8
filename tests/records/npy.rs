//! Records from NumPy files.

use greybox::pmsm::{Currents, Drive, Surface, Winding};
use greybox::{Experiment, Fit, Time, free, simulate};
use std::path::{Path, PathBuf};

/// A file as `numpy.save` writes it (format 1.0): magic, version, length of the header, the header padded to 64 bytes.
fn save(path: &Path, kind: &str, shape: &str, bytes: &[u8]) {
    let mut header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}");
    while (10 + header.len() + 1) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    let length = u16::try_from(header.len()).unwrap().to_le_bytes();
    std::fs::write(path, [b"\x93NUMPY\x01\x00", &length[..], header.as_bytes(), bytes].concat()).unwrap();
}

fn numbers(path: &Path, values: impl Iterator<Item = f64>) {
    let bytes: Vec<u8> = values.flat_map(f64::to_le_bytes).collect();
    save(path, "<f8", &format!("({},)", bytes.len() / 8), &bytes);
}

fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

#[test]
#[cfg_attr(target_endian = "big", ignore = "the files are little-endian")]
fn a_folder_of_columns_is_the_record() {
    let model = Surface::new(4).unwrap();
    let samples = 3000;
    let drive = |k: usize| Drive { ud: (k as f64 * 0.1).sin(), uq: 20.0 + (k as f64 * 0.03).cos(), w: 30.0 };
    let inputs: Vec<_> = (0..samples).map(drive).collect();
    let (time, truth) = (Time::Uniform { start: 0.0, step: 1e-4 }, Winding { rs: 0.8, ls: 4e-3, ke: 0.6 });
    let run = simulate(&model, &truth, &Currents { id: 0.0, iq: 0.0 }, time, &inputs).unwrap();
    let record = run.with_noise(Currents { id: 0.1, iq: 0.1 }, 5).experiment(&model).unwrap();
    let folder = folder("columns");
    let file = |name: &str| folder.join(format!("{name}.npy"));
    numbers(&file("ud"), record.inputs().map(|u| u.ud));
    numbers(&file("uq"), record.inputs().map(|u| u.uq));
    numbers(&file("w"), record.inputs().map(|u| u.w));
    numbers(&file("id"), record.outputs().map(|y| y.id));
    numbers(&file("iq"), record.outputs().map(|y| y.iq));
    numbers(&file("t"), (0..samples).map(|k| k as f64 * 1e-4));
    let mapped = Experiment::from_npy(&model, &folder, Some(1e-4)).unwrap();
    assert_eq!(mapped.record().name(), "columns");
    let stamped = Experiment::from_npy(&model, &folder, None).unwrap();
    let fit = |record| {
        let parameters = Winding { rs: free(1.0), ls: free(3e-3), ke: free(0.5) };
        Fit::new(&model, record).parameters(parameters).run().unwrap()
    };
    let (a, b, c) = (fit(&record), fit(&mapped), fit(&stamped));
    let bits = |p: Winding<f64>| [p.rs, p.ls, p.ke].map(f64::to_bits);
    assert_eq!(bits(a.parameters), bits(b.parameters));
    // Time stamps are rounded: the steps between them differ by 1e-12 of a step.
    assert!((a.parameters.rs - c.parameters.rs).abs() < 1e-8 * a.parameters.rs);
}

#[test]
fn files_that_are_something_else_are_named() {
    let model = Surface::new(4).unwrap();
    let folder = folder("wrong");
    let file = |name: &str| folder.join(format!("{name}.npy"));
    let refused = || Experiment::from_npy(&model, &folder, Some(1e-4)).err().unwrap().to_string();
    for name in ["uq", "w", "id", "iq"] {
        numbers(&file(name), (0..10).map(f64::from));
    }
    let _ = std::fs::remove_file(file("ud"));
    assert!(refused().contains("ud.npy"), "{}", refused());
    save(&file("ud"), "<f4", "(10,)", &[0; 40]);
    assert!(refused().contains("float64"), "{}", refused());
    save(&file("ud"), ">f8", "(10,)", &[0; 80]);
    assert!(refused().contains("byte order"), "{}", refused());
    save(&file("ud"), "<i8", "(10,)", &[0; 80]);
    assert!(refused().contains("float64"), "{}", refused());
    save(&file("ud"), "<f8", "(5, 2)", &[0; 80]);
    assert!(refused().contains("[5, 2]"), "{}", refused());
    // Cut short, and longer than it says.
    for bytes in [72, 77, 88] {
        save(&file("ud"), "<f8", "(10,)", &vec![0; bytes]);
        assert!(refused().contains("shape [10]"), "{}", refused());
    }
    std::fs::write(file("ud"), "t,ud\n0,1\n").unwrap();
    assert!(refused().contains("ud.npy"), "{}", refused());
    save(&file("ud"), "<f8", "(9,)", &[0; 72]);
    assert!(refused().contains("ud"), "{}", refused());
}
