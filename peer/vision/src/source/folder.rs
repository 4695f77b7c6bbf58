//! A folder of images as a camera.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::image_file::read_image;
use super::{Frame, Scene, Source, SourceError};
use crate::dataset::has_image_name;

/// The most images that one folder may hold.
const MAX_IMAGES: usize = 100_000;

/// The JPEG and PNG files of one folder, in the order of their names. A file that cannot be read is an error for its
/// frame alone.
#[derive(Debug)]
pub struct ImageFolder {
    folder: PathBuf,
    images: Vec<PathBuf>,
    next: usize,
    period: Duration,
    looping: bool,
}

impl ImageFolder {
    /// The images of `folder`, one every `period`; when `looping`, it starts again after the last one.
    ///
    /// # Errors
    /// When the folder cannot be read, holds no file named `*.jpg`, `*.jpeg` or `*.png`, or more than 100,000.
    pub fn open(folder: &Path, period: Duration, looping: bool) -> Result<Self, SourceError> {
        Ok(Self { folder: folder.into(), images: listed(folder)?, next: 0, period, looping })
    }

    /// What is read of the next file. The folder is listed anew whenever it starts again.
    ///
    /// # Errors
    /// [`SourceError::Ended`], and those of [`ImageFolder::open`]; those of `read` are of one file.
    pub fn read_next<T>(
        &mut self,
        read: impl FnOnce(&Path) -> Result<T, SourceError>,
    ) -> Result<T, SourceError> {
        read(self.next_file()?).map_err(SourceError::of_one_file)
    }

    fn next_file(&mut self) -> Result<&Path, SourceError> {
        if self.next == self.images.len() && self.looping {
            (self.images, self.next) = (listed(&self.folder)?, 0);
        }
        let path = self.images.get(self.next).ok_or_else(|| {
            SourceError::Ended(format!("{}, {} frames in all,", self.describe(), self.images.len()))
        })?;
        self.next += 1;
        Ok(path)
    }
}

/// The images of a folder by name.
fn listed(folder: &Path) -> Result<Vec<PathBuf>, SourceError> {
    let unreadable = |cause| SourceError::io(folder, cause);
    let mut images = Vec::new();
    for entry in fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        if has_image_name(&path) {
            images.push(path);
        }
        if images.len() > MAX_IMAGES {
            return Err(SourceError::TooLarge {
                path: folder.into(),
                size: format!("more than {MAX_IMAGES} images"),
                limit: format!("{MAX_IMAGES} images"),
            });
        }
    }
    if images.is_empty() {
        return Err(SourceError::NoImages(folder.into()));
    }
    images.sort();
    Ok(images)
}

impl Source for ImageFolder {
    fn describe(&self) -> String {
        format!("images {}", self.folder.display())
    }

    fn period(&self) -> Duration {
        self.period
    }

    fn next_frame(&mut self, now: Duration, _: &Scene) -> Result<Frame, SourceError> {
        Ok(Frame { image: self.read_next(read_image)?, at: now })
    }
}

#[cfg(test)]
mod tests {
    use opencv::core::{self, Mat, Scalar, Vector};
    use opencv::imgcodecs;
    use opencv::prelude::*;

    use super::*;

    fn write_grey(path: &Path, width: i32) {
        let image = Mat::new_rows_cols_with_default(20, width, core::CV_8UC3, Scalar::all(90.0)).unwrap();
        assert!(imgcodecs::imwrite(path, &image, &Vector::new()).unwrap());
    }

    fn next_width(source: &mut ImageFolder) -> Result<i32, SourceError> {
        Ok(source.next_frame(Duration::ZERO, &Scene::default())?.image.cols())
    }

    #[test]
    fn images_come_in_the_order_of_their_names_and_then_the_folder_ends() {
        let folder = tempfile::tempdir().unwrap();
        write_grey(&folder.path().join("b.png"), 22);
        write_grey(&folder.path().join("a.JPG"), 21);
        fs::write(folder.path().join("README.md"), "not for the camera").unwrap();
        let mut source = ImageFolder::open(folder.path(), Duration::from_secs(1), false).unwrap();
        assert_eq!(next_width(&mut source).unwrap(), 21);
        assert_eq!(next_width(&mut source).unwrap(), 22);
        for _ in 0..2 {
            assert!(matches!(next_width(&mut source), Err(SourceError::Ended(_))));
        }
        let said = next_width(&mut source).unwrap_err().to_string();
        assert!(said.contains(", 2 frames in all, has ended"), "{said}");
    }

    #[test]
    fn a_bad_file_costs_one_frame_of_a_loop() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("a.jpg"), "a shopping list").unwrap();
        write_grey(&folder.path().join("b.jpg"), 22);
        let mut source = ImageFolder::open(folder.path(), Duration::from_secs(1), true).unwrap();
        for _ in 0..3 {
            let error = next_width(&mut source).unwrap_err();
            assert!(error.to_string().contains("a.jpg"), "{error}");
            assert_eq!(next_width(&mut source).unwrap(), 22);
        }
    }

    #[test]
    fn what_cannot_be_opened_costs_one_frame_too() {
        let folder = tempfile::tempdir().unwrap();
        for n in 0..12 {
            std::os::unix::fs::symlink("nowhere", folder.path().join(format!("a{n}.jpg"))).unwrap();
        }
        fs::create_dir(folder.path().join("b.jpg")).unwrap();
        write_grey(&folder.path().join("c.jpg"), 22);
        let mut source = ImageFolder::open(folder.path(), Duration::from_secs(1), false).unwrap();
        for _ in 0..13 {
            let error = next_width(&mut source).unwrap_err();
            assert!(error.is_of_one_picture() && error.to_string().contains(".jpg"), "{error}");
        }
        assert_eq!(next_width(&mut source).unwrap(), 22);
    }

    #[test]
    fn a_folder_that_is_filled_anew_is_listed_anew() {
        let folder = tempfile::tempdir().unwrap();
        write_grey(&folder.path().join("a.jpg"), 21);
        let mut source = ImageFolder::open(folder.path(), Duration::from_secs(1), true).unwrap();
        assert_eq!(next_width(&mut source).unwrap(), 21);
        fs::remove_file(folder.path().join("a.jpg")).unwrap();
        for _ in 0..2 {
            assert!(matches!(next_width(&mut source), Err(SourceError::NoImages(_))));
        }
        write_grey(&folder.path().join("b.jpg"), 22);
        assert_eq!(next_width(&mut source).unwrap(), 22);
    }

    #[test]
    fn a_folder_without_images_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let open = |path: &Path| ImageFolder::open(path, Duration::from_secs(1), true).unwrap_err();
        assert!(matches!(open(folder.path()), SourceError::NoImages(_)));
        assert!(matches!(open(&folder.path().join("missing")), SourceError::Missing(_)));
        fs::write(folder.path().join("file"), "x").unwrap();
        assert!(matches!(open(&folder.path().join("file")), SourceError::Unreadable { .. }));
    }
}
