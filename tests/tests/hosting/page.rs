//! The page of datasets, in a real browser.

use std::{fs, path::Path};

use image::RgbaImage;

use crate::{
    browser::{Look, elements, photograph},
    server,
};

const DESK: Look = Look { width: 1280, height: 1000, is_dark: false };
const PHONE: Look = Look { width: 390, height: 1400, ..DESK };

/// The colour of most pixels.
fn ground(picture: &RgbaImage) -> [u8; 3] {
    let mut counts = std::collections::HashMap::new();
    for pixel in picture.pixels() {
        *counts.entry([pixel[0], pixel[1], pixel[2]]).or_insert(0) += 1;
    }
    counts.into_iter().max_by_key(|(_, count)| *count).expect("pixels").0
}

fn brightness([red, green, blue]: [u8; 3]) -> u32 {
    u32::from(red) + u32::from(green) + u32::from(blue)
}

#[test]
fn the_page_is_readable_on_a_desk_and_on_a_phone_by_day_and_by_night() {
    let data = tempfile::tempdir().expect("a temporary folder");
    server::build(&data.path().join("courtyard.lods"), "200k", 1);
    server::build(&data.path().join("a name that is rather long, as some are.lods"), "20k", 2);
    fs::write(data.path().join("broken.lods"), "broken").expect("writable");
    let (_server, url) = server::serve(data.path().to_str().expect("a plain path"), &[]);
    // Kept, so that a person can look at them.
    let pictures = Path::new(env!("CARGO_TARGET_TMPDIR")).join("page");
    fs::create_dir_all(&pictures).expect("writable");
    let look = |name: &str, look: Look| photograph(&url, look, &pictures.join(name));

    let day = look("desk-day.png", DESK);
    let night = look("desk-night.png", Look { is_dark: true, ..DESK });
    assert!(brightness(ground(&day)) > 600, "by day it is light");
    assert!(brightness(ground(&night)) < 200, "by night it is dark");
    let colors: std::collections::HashSet<_> = day.pixels().map(|p| [p[0], p[1], p[2]]).collect();
    assert!(colors.len() > 2000, "{} colours: no preview is shown", colors.len());
    look("phone-day.png", PHONE);
    look("phone-night.png", Look { is_dark: true, ..PHONE });

    // (No scripts run in any of these: the page's policy forbids them.)
    let shown = elements(&url, PHONE);
    for part in ["courtyard", "200,000", "Extent", "just now", "intensity", "broken.lods"] {
        assert!(shown.contains(part), "{part} is not on the page: {shown}");
    }
    assert!(shown.contains(&format!("{url}/datasets/<wbr>courtyard.lods")), "{shown}");

    // Nothing sticks out: in a frame as narrow as the narrowest phone, the page is as wide as the
    // frame, which the page around it says.
    let probe = data.path().join("probe.html");
    let page = text_of(&url).replace("<img src=\"", &format!("<img src=\"{url}/"));
    fs::write(data.path().join("page.html"), page).expect("writable");
    fs::write(
        &probe,
        "<!doctype html><iframe id=f width=360 height=800 src=page.html></iframe><p id=out></p><script>\
         f.onload = () => { const d = f.contentDocument.documentElement; \
         out.textContent = 'width ' + d.scrollWidth + ' of ' + d.clientWidth }</script>",
    )
    .expect("writable");
    let told = crate::browser::elements_of_file(&probe, PHONE);
    let widths = told.split_once("id=\"out\">width ").and_then(|(_, rest)| rest.split_once('<'));
    let (page, frame) = widths.and_then(|(text, _)| text.split_once(" of ")).expect("two widths");
    assert_eq!(page, frame, "the page is wider than its frame");
}

/// The page's text.
fn text_of(url: &str) -> String {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    runtime.expect("a runtime").block_on(async {
        let _ = rustls::crypto::ring::default_provider().install_default();
        let response = reqwest::get(url).await.expect("an answer");
        response.text().await.expect("a page")
    })
}
