//! Model files are those of `gestalt train`: the ones in this repository are read, and written again byte for byte.

use gestalt_mind::{ModelFile, ModelFileError};
use gestalt_strategies::Classify;

const MODELS: [&[u8]; 2] = [
    include_bytes!("../../../peer/vision/models/rendered.gestalt"),
    include_bytes!("../../../peer/vision/models/hands.gestalt"),
];

#[test]
fn the_models_that_gestalt_train_wrote_are_read_and_written_again_byte_for_byte() {
    for bytes in MODELS {
        let model = ModelFile::decode(bytes).unwrap();
        assert_eq!(model.encode(), bytes);
        let features = vec![0.0; model.classifier.space().features()];
        let probabilities = model.classifier.probabilities(&features).unwrap();
        assert!((probabilities.iter().sum::<f64>() - 1.0).abs() < 1e-9);
    }
}

#[test]
fn bytes_that_are_no_whole_model_are_refused_by_their_reason() {
    let whole = MODELS[0];
    let changed = |place: usize, value: u8| {
        let mut bytes = whole.to_vec();
        bytes[place] = value;
        ModelFile::decode(&bytes).unwrap_err()
    };
    assert_eq!(ModelFile::decode(&[]), Err(ModelFileError::NotAModel));
    assert_eq!(changed(0, b'X'), ModelFileError::NotAModel);
    assert_eq!(changed(8, 9), ModelFileError::Version(9));
    assert!(matches!(changed(17, 1), ModelFileError::TooLarge(_)));
    assert_eq!(changed(whole.len() - 1, !whole[whole.len() - 1]), ModelFileError::Damaged);
    let cut = ModelFile::decode(&whole[..whole.len() - 1]);
    assert!(matches!(cut, Err(ModelFileError::CutShort { .. })), "{cut:?}");
    assert_eq!(ModelFile::decode(&[whole, &[0]].concat()), Err(ModelFileError::Damaged));
}
