//! Builds that end without a dataset.

use super::*;

#[test]
fn a_cancelled_build_leaves_nothing() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let config = config(folder.path(), &[[0, 0, 0], [5, 5, 5]], 1, 1 << 20);
    config.cancel.store(true, Ordering::Relaxed);
    let result = build(&config, &Quiet);
    assert!(matches!(result, Err(Error::Interrupted)), "{result:?}");
    let left: Vec<_> = std::fs::read_dir(folder.path()).expect("there").collect();
    assert_eq!(left.len(), 1, "only the input is there: {left:?}");
}

#[test]
fn a_folder_is_no_output() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let mut config = config(folder.path(), &[[0, 0, 0]], 1, 1 << 20);
    config.output = folder.path().to_path_buf();
    let error = build(&config, &Quiet).expect_err("refused").to_string();
    assert!(error.contains("is a folder; name a file"), "{error}");
}

#[test]
fn what_no_disk_has_room_for_is_refused_before_it_is_read() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let mut config = config(folder.path(), &[], 1, 1 << 30);
    config.inputs = vec!["sim:courtyard?points=1000G".into()];
    config.columns = None;
    // Should it not be refused, it must not begin either.
    config.cancel.store(true, Ordering::Relaxed);
    let error = build(&config, &Quiet).expect_err("refused").to_string();
    assert!(error.contains("the build needs about") && error.contains("raise --memory"), "{error}");
    // All that memory can hold: nothing goes to the disk but the dataset.
    config.memory_bytes = u64::MAX;
    let error = build(&config, &Quiet).expect_err("refused").to_string();
    assert!(error.ends_with("choose another place for the output"), "{error}");
}

#[test]
fn an_attribute_that_no_input_has_cannot_be_dropped() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let mut config = config(folder.path(), &[[0, 0, 0]], 1, 1 << 20);
    config.drop_attributes = vec!["intensity".into()];
    let error = build(&config, &Quiet).expect_err("refused").to_string();
    assert_eq!(error, "--drop intensity: no input has this attribute");
}
