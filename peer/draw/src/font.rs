//! The fonts that text is set in: one that is always there, and the system's for signs that it lacks.

use std::sync::{Arc, LazyLock};

use resvg::usvg::FontResolver;
use resvg::usvg::fontdb::Database;

/// DejaVu Sans: Latin, Greek, Cyrillic, Armenian, Georgian, Hebrew, Arabic, Lao and the mathematical signs.
pub(crate) const FONT: &[u8] = include_bytes!("../fonts/DejaVuSans.ttf");
pub(crate) const FAMILY: &str = "DejaVu Sans";

/// The embedded font, for every family that a drawing may name. Read once.
pub(crate) fn embedded() -> Arc<Database> {
    static FONTS: LazyLock<Arc<Database>> = LazyLock::new(|| {
        let mut fonts = Database::new();
        fonts.load_font_data(FONT.to_vec());
        fonts.set_sans_serif_family(FAMILY);
        fonts.set_serif_family(FAMILY);
        fonts.set_monospace_family(FAMILY);
        Arc::new(fonts)
    });
    FONTS.clone()
}

/// The embedded font and those of the system, which are many files, seldom needed. Read once.
fn with_the_systems() -> Arc<Database> {
    static FONTS: LazyLock<Arc<Database>> = LazyLock::new(|| {
        let mut fonts = Database::clone(&embedded());
        fonts.load_system_fonts();
        Arc::new(fonts)
    });
    FONTS.clone()
}

/// Takes, for a sign that a text's font lacks, the first of the system's fonts that has it.
pub(crate) fn resolver() -> FontResolver<'static> {
    let among_known = FontResolver::default_fallback_selector();
    FontResolver {
        select_fallback: Box::new(move |sign, tried, fonts| {
            if fonts.len() == embedded().len() {
                *fonts = with_the_systems();
            }
            among_known(sign, tried, fonts)
        }),
        ..FontResolver::default()
    }
}
