//! What is listed of folders, and what is said of those that are no datasets.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::*;

fn dataset(files: &[&str]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for file in files {
        let path = folder.path().join(file);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, "").unwrap();
    }
    folder
}

fn strings(labels: &[&str]) -> Vec<String> {
    labels.iter().map(|label| (*label).to_owned()).collect()
}

#[cfg(unix)]
#[test]
fn a_name_in_another_encoding_hides_no_folder_and_no_person() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;

    let folder = dataset(&["a/s001_1.png", "b/s002_1.png"]);
    let latin = OsStr::from_bytes(b"s007_k\xfche.png");
    fs::write(folder.path().join("a").join(latin), "").unwrap();
    let hidden = folder.path().join(OsStr::from_bytes(b"k\xfche"));
    fs::create_dir(&hidden).unwrap();
    fs::write(hidden.join("s001_1.png"), "").unwrap();
    let listed = Dataset::list(folder.path(), None).unwrap();
    assert_eq!(listed.people(), [1, 2, 7].into());
    assert_eq!(listed.ignored.iter().map(|ignored| ignored.images).collect::<Vec<_>>(), [1]);
    let of = |name: &str| person(Path::new(name));
    assert_eq!(
        ["s001_x", "s12_", "s_x", "x001_x", "s1x_y", "s001", "s99999999999_x"].map(of),
        [Some(1), Some(12), None, None, None, None, None]
    );
}

#[test]
fn a_folder_of_other_gestures_is_not_called_empty() {
    let folder = dataset(&["fist/1.png", "palm/2.png"]);
    let of = |error: DatasetError| error.to_string();
    let others = of(Dataset::list_known(
        folder.path(),
        Naming::Names,
        &Vocabulary::new(["0", "1"].map(str::to_owned).to_vec()).unwrap(),
    )
    .unwrap_err());
    assert!(others.contains("the gestures 0, 1: its folders are fist, palm"), "{others}");
    let counts = of(Dataset::list_several(&[folder.path().to_owned()], Naming::Counts, None).unwrap_err());
    assert!(counts.contains("counts of fingers") && counts.contains("fist, palm"), "{counts}");
    let nothing = dataset(&["none/1.png"]);
    let nothing = of(Dataset::list(nothing.path(), None).unwrap_err());
    assert!(nothing.ends_with("its folders are none"), "{nothing}");
    let empty = of(Dataset::list(tempfile::tempdir().unwrap().path(), None).unwrap_err());
    assert!(empty.contains("no subfolders with images"), "{empty}");
}

#[test]
fn folders_are_gestures_and_prefixes_are_people() {
    let folder = dataset(&[
        "10/s003_a.jpg",
        "9/s12_b.PNG",
        "9/sx_c.jpeg",
        "9/s_.jpg",
        "9/notes.txt",
        "README",
        "empty/x",
    ]);
    let dataset = Dataset::list(folder.path(), None).unwrap();
    assert_eq!(dataset.vocabulary.labels(), ["9", "10"]);
    let seen: Vec<_> = dataset
        .images
        .iter()
        .map(|image| (image.class.0, image.person, image.path.file_name().unwrap().to_str().unwrap()))
        .collect();
    assert_eq!(
        seen,
        [(0, Some(12), "s12_b.PNG"), (0, None, "s_.jpg"), (0, None, "sx_c.jpeg"), (1, Some(3), "s003_a.jpg")]
    );
}

#[test]
fn chosen_gestures_keep_the_order_they_were_chosen_in() {
    let folder = dataset(&["a/1.jpg", "b/1.jpg", "c/1.jpg"]);
    let chosen = Dataset::list(folder.path(), Some(&strings(&["c", "a"]))).unwrap();
    assert_eq!(chosen.vocabulary.labels(), ["c", "a"]);
    assert_eq!(chosen.ignored, [Ignored { label: "b".to_owned(), images: 1, others: 0 }]);
    let missing = Dataset::list(folder.path(), Some(&strings(&["a", "d"]))).unwrap_err();
    assert!(missing.to_string().contains("'d': it has a, b, c"), "{missing}");
}

#[test]
fn a_folder_without_images_is_no_dataset() {
    for files in [&["a.jpg"][..], &["a/notes.txt"], &[]] {
        let folder = dataset(files);
        assert!(matches!(Dataset::list(folder.path(), None), Err(DatasetError::Empty(_))), "{files:?}");
    }
    let missing = Dataset::list(Path::new("/nowhere"), None);
    assert!(matches!(missing, Err(DatasetError::Io { .. })));
    let one = dataset(&["a/1.jpg"]);
    assert!(matches!(Dataset::list(one.path(), None), Err(DatasetError::Vocabulary { .. })));
}

#[test]
fn a_model_sees_the_gestures_it_knows() {
    let folder = dataset(&["1/x.jpg", "background/x.jpg"]);
    let vocabulary = Vocabulary::new(["0", "1"]).unwrap();
    let known = Dataset::list_known(folder.path(), Naming::Names, &vocabulary).unwrap();
    assert_eq!((known.images.len(), known.images[0].class), (1, ClassId(1)));
    assert_eq!(said(&known), ["background (1 images)"]);
    let stranger = Vocabulary::new(["x", "y"]).unwrap();
    let unknown = Dataset::list_known(folder.path(), Naming::Names, &stranger);
    assert!(matches!(unknown, Err(DatasetError::Others { .. })));
    // A count that the model does not know is said, and no error.
    let unknown = Dataset::list_known(folder.path(), Naming::Counts, &stranger).unwrap();
    assert!(unknown.images.is_empty());
    assert_eq!(said(&unknown), ["1 (1 images)", "background (1 images)"]);
}

fn said(dataset: &Dataset) -> Vec<String> {
    dataset.ignored.iter().map(Ignored::to_string).collect()
}

#[test]
fn folders_can_be_counts_of_fingers() {
    let folder = dataset(&[
        "3/a.jpg",
        "3_thumb/b.jpg",
        "03-thumb/f.jpg",
        "3_thumb/boxes.csv",
        "0/c.jpg",
        "call/d.jpg",
        "none/e.jpg",
        "LICENCE.txt",
    ]);
    let folders = [folder.path().to_owned()];
    let counts = Dataset::list_several(&folders, Naming::Counts, None).unwrap().remove(0);
    assert_eq!(counts.vocabulary.labels(), ["0", "3"]);
    assert_eq!(counts.images.iter().map(|image| image.class.0).collect::<Vec<_>>(), [0, 1, 1, 1]);
    assert_eq!((said(&counts), counts.none.len()), (vec!["call (1 images)".to_owned()], 1));
}

#[test]
fn pictures_without_a_gesture_are_nobodys_class() {
    let folder = dataset(&["a/1.jpg", "b/1.jpg", "none/1.jpg", "none/2.jpg"]);
    let all = Dataset::list(folder.path(), None).unwrap();
    assert_eq!(
        (all.vocabulary.labels(), all.images.len(), all.none.len()),
        (&strings(&["a", "b"])[..], 2, 2)
    );
    let asked = Dataset::list(folder.path(), Some(&strings(&["a", "none"])));
    assert!(matches!(asked, Err(DatasetError::NoGesture)));
}

#[test]
fn several_datasets_have_one_vocabulary_and_no_person_in_common() {
    let sets =
        [dataset(&["1/s001_a.jpg", "2/s007_a.jpg", "2/x.jpg"]), dataset(&["2/s001_a.jpg", "3/s002_a.jpg"])];
    let negatives = dataset(&["none/x.jpg"]);
    let folders: Vec<PathBuf> =
        sets.iter().chain([&negatives]).map(|folder| folder.path().to_owned()).collect();
    let listed = Dataset::list_several(&folders, Naming::Names, None).unwrap();
    assert!(listed.iter().all(|set| set.vocabulary.labels() == ["1", "2", "3"]));
    let shown = |set: &Dataset| set.images.iter().map(|i| (i.class.0, i.person)).collect::<Vec<_>>();
    assert_eq!(shown(&listed[0]), [(0, Some(0)), (1, Some(1)), (1, None)]);
    assert_eq!(shown(&listed[1]), [(1, Some(2)), (2, Some(3))]);
    assert_eq!((listed[2].images.len(), listed[2].none.len()), (0, 1));

    let chosen = Dataset::list_several(&folders, Naming::Names, Some(&strings(&["3", "1"]))).unwrap();
    assert_eq!((shown(&chosen[0]), shown(&chosen[1])), (vec![(1, Some(0))], vec![(0, Some(1))]));
    let missing = Dataset::list_several(&folders, Naming::Names, Some(&strings(&["1", "9"]))).unwrap_err();
    assert!(missing.to_string().contains("'9': it has 1, 2, 3"), "{missing}");
    let twice = [folders[0].clone(), folders[0].join("../").join(folders[0].file_name().unwrap())];
    let twice = Dataset::list_several(&twice, Naming::Names, None);
    assert!(matches!(twice, Err(DatasetError::Twice(_))));
}

#[test]
fn a_copy_of_an_image_has_its_fingerprint() {
    let folder = dataset(&["a/1.jpg", "b/2.jpg", "b/3.jpg"]);
    fs::write(folder.path().join("a/1.jpg"), "hand").unwrap();
    fs::write(folder.path().join("b/2.jpg"), "hand").unwrap();
    fs::write(folder.path().join("b/3.jpg"), "hane").unwrap();
    let images = Dataset::list(folder.path(), None).unwrap().images;
    let prints: Vec<u64> = images.iter().map(|image| image.fingerprint().unwrap()).collect();
    assert!(prints[0] == prints[1] && prints[1] != prints[2], "{prints:x?}");
}

#[test]
fn of_copies_one_is_left_in_whose_person_is_known() {
    let [one, other] = [
        dataset(&["a/x.jpg", "a/y.jpg", "b/s001_x.jpg", "b/s002_x.jpg"]),
        dataset(&["a/s001_z.jpg", "b/x.jpg"]),
    ];
    for copy in
        [one.path().join("a/x.jpg"), one.path().join("b/s002_x.jpg"), other.path().join("a/s001_z.jpg")]
    {
        fs::write(copy, "hand").unwrap();
    }
    fs::write(one.path().join("a/y.jpg"), "another hand").unwrap();
    fs::write(other.path().join("b/x.jpg"), "another hand").unwrap();
    let folders = [&one, &other].map(|folder| folder.path().to_owned());
    let mut sets = Dataset::list_several(&folders, Naming::Names, None).unwrap();
    assert_eq!(leave_out_copies(&mut sets), 3);
    let left = |set: &Dataset| -> Vec<String> {
        set.images
            .iter()
            .map(|image| image.path.file_name().unwrap().to_string_lossy().into_owned())
            .collect()
    };
    assert_eq!([left(&sets[0]), left(&sets[1])], [vec!["y.jpg", "s001_x.jpg", "s002_x.jpg"], vec![]]);
    assert_eq!(leave_out_copies(&mut sets), 0);
}

#[test]
fn a_share_of_the_people_is_drawn_by_the_seed() {
    let names: Vec<String> =
        (0..10).flat_map(|i| [format!("a/s{i}_1.jpg"), format!("b/s{i}_1.jpg")]).collect();
    let folder = dataset(&names.iter().map(String::as_str).collect::<Vec<_>>());
    let dataset = Dataset::list(folder.path(), None).unwrap();
    let draw = |share, seed| dataset.draw_people(share, &mut ChaCha8Rng::seed_from_u64(seed));
    assert_eq!(draw(0.3, 1).len(), 3);
    assert_eq!(draw(0.3, 1), draw(0.3, 1));
    assert!((2..9).any(|seed| draw(0.3, seed) != draw(0.3, 1)));
    assert_eq!((draw(0.0, 1).len(), draw(0.001, 1).len(), draw(0.999, 1).len()), (0, 1, 9));
}
