//! Errors and what they say.

/// The error of a result; its message must hold every one of `parts`.
#[track_caller]
pub fn says<T, E: std::fmt::Display>(result: Result<T, E>, parts: &[&str]) -> E {
    let Err(error) = result else { panic!("no error; expected {parts:?}") };
    let message = error.to_string();
    println!("{message}\n");
    for part in parts {
        assert!(message.contains(part), "`{part}` is not in: {message}");
    }
    error
}
