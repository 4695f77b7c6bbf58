//! What people and a swarm say to each other by its page, in a browser: a question and its answer, and the name of a new gesture.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::time::{Duration, Instant};

use gestalt_link::{LinkConfig, RobotConfig};
use gestalt_protocol::ClassId;
use gestalt_strategies::{Classify, ClassifyError, Observation, Vocabulary};
use gestalt_tests::{
    Browser, Watched, between, config, gesture, learning, short_rounds, start_looking, unique,
};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde_json::{Value, json};
use tokio::task::block_in_place;

use crate::page::desk;

const PATIENCE: Duration = Duration::from_secs(30);

/// Stands for what lies between two of them.
const BETWEEN: u8 = 99;

const GESTURES: [&str; 6] =
    ["fist", "one finger", "two fingers", "three fingers", "four fingers", "open palm"];

/// Robots that were taught well enough: tells gestures apart by which feature is high, and is torn where two are.
#[derive(Debug)]
struct Taught(Vocabulary);

impl Classify for Taught {
    fn vocabulary(&self) -> &Vocabulary {
        &self.0
    }

    fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
        let odds: Vec<f64> = features[..6].iter().map(|high| (4.0 * f64::from(*high)).exp()).collect();
        let sum: f64 = odds.iter().sum();
        Ok(odds.iter().map(|odds| 0.9 * odds / sum + 0.1 / 6.0).collect())
    }
}

/// What robot `id` sees: a gesture, or what lies between two.
fn seen(id: u32, shown: u8, rng: &mut ChaCha8Rng) -> Observation {
    match shown {
        BETWEEN => between(id, [ClassId(2), ClassId(3)], rng),
        class => gesture(ClassId(class.into()), rng),
    }
}

/// Three robots in a line that know their gestures, and may ask soon.
async fn line(swarm: &str, shown: &Arc<AtomicU8>) -> Vec<Watched> {
    let vocabulary = Vocabulary::new(GESTURES.map(str::to_owned)).unwrap();
    let mut line: Vec<Watched> = Vec::new();
    for id in 0..3 {
        let connect: Vec<String> =
            line.last().map(|before| before.robot.locators()[0].clone()).into_iter().collect();
        let mut learning = learning(3, 1.0, None);
        learning.vocabulary = vocabulary.clone();
        let questions = &mut learning.config.questions;
        (questions.rounds, questions.apart) = (1, Duration::from_secs(1));
        let config = RobotConfig {
            mind: short_rounds(),
            vocabulary: Some(vocabulary.clone()),
            learning: Some(learning),
            ..config(id, swarm, &connect)
        };
        let (shown, mut rng) = (shown.clone(), ChaCha8Rng::seed_from_u64(id.into()));
        let robot = start_looking(config, move || seen(id, shown.load(Ordering::Relaxed), &mut rng)).await;
        robot.robot.learned(Arc::new(Taught(vocabulary.clone())), "taught");
        line.push(robot);
    }
    for robot in &line {
        assert!(robot.sees_alive(2, PATIENCE).await);
    }
    line
}

/// What is wrong with the looks of the page as it stands: parts that lie on each other or reach beyond the window, words that are cut off,
/// and words too pale for their ground (WCAG AA: 4.5 to 1).
const FLAWS: &str = r"(() => {
  const flaws = [], name = (it) => `${it.tagName} ${it.id} '${it.textContent.slice(0, 30)}'`;
  const wide = document.documentElement.scrollWidth - innerWidth;
  if (wide > 0) flaws.push(`the page is ${wide} px wider than the window`);
  const shown = (it) => it.checkVisibility() && it.textContent + it.tagName !== 'P';
  const pressed = [...document.querySelectorAll('#decision button, #decision summary, #decision input, #decision label, #decision p')].filter(shown);
  const boxes = pressed.map((it) => [it, it.getBoundingClientRect()]);
  boxes.forEach(([one, a], k) => boxes.slice(k + 1).forEach(([other, b]) => {
    const over = Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1 && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 1;
    if (over && !one.contains(other) && !other.contains(one)) flaws.push(`${name(one)} lies on ${name(other)}`);
  }));
  for (const [it, box] of boxes) {
    if (box.left < 0 || box.right > innerWidth + 1) flaws.push(`${name(it)} reaches beyond the window`);
    if (it.tagName !== 'P' && it.scrollWidth > it.clientWidth + 1) flaws.push(`${name(it)} is cut off`);
    if (['BUTTON', 'SUMMARY', 'INPUT'].includes(it.tagName) && box.height < 40) flaws.push(`${name(it)} is ${box.height} px high, too low for a finger`);
  }
  for (const it of document.querySelectorAll('#reasons .who, #reasons .what')) {
    if (shown(it) && it.scrollWidth > it.clientWidth + 1) flaws.push(`${name(it)} is cut off`);
  }
  const parts = (colour) => colour.match(/[\d.]+/g).map(Number);
  const light = (rgb) => rgb.slice(0, 3).map((v) => v / 255).map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4))
    .reduce((sum, v, k) => sum + v * [0.2126, 0.7152, 0.0722][k], 0);
  const ground = (it) => {
    for (let at = it; at; at = at.parentElement) {
      const colour = parts(getComputedStyle(at).backgroundColor);
      if (colour.length < 4 || colour[3] === 1) return colour;
    }
    return [255, 255, 255];
  };
  for (const it of document.querySelectorAll('#decision *')) {
    const words = [...it.childNodes].some((node) => node.nodeType === 3 && node.textContent.trim());
    if (!words || !shown(it)) continue;
    const [a, b] = [light(parts(getComputedStyle(it).color)), light(ground(it))];
    const contrast = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    if (contrast < 4.5) flaws.push(`${name(it)} has a contrast of ${contrast.toFixed(1)}`);
  }
  return flaws;
})()";

/// Draws the page as a phone and a desk show it, by day and by night, into the folder of this run's pictures; nothing of it looks wrong.
fn draw(browser: &mut Browser, what: &str) {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("page");
    std::fs::create_dir_all(&folder).unwrap();
    for (device, size) in [("phone", (360, 740)), ("desk", (1280, 800))] {
        for (time, dark) in [("day", false), ("night", true)] {
            let picture = browser.picture(size, dark);
            let file = folder.join(format!("{what}-{device}-{time}.png"));
            std::fs::write(&file, picture).unwrap();
            let flaws = browser.evaluate(FLAWS);
            assert_eq!(flaws, json!([]), "{}", file.display());
        }
    }
}

/// The words on the buttons that answer the question.
const REPLIES: &str = "[...document.querySelectorAll('#replies button')].map(it => it.textContent)";

pub async fn a_question_of_the_swarm_is_answered_by_its_button_and_a_new_gesture_is_named() {
    let (swarm, shown) = (unique("talking"), Arc::new(AtomicU8::new(BETWEEN)));
    let robots = line(&swarm, &shown).await;
    let link = LinkConfig { connect: robots[2].robot.locators().to_vec(), ..LinkConfig::default() };
    let desk = desk(&swarm, &link, 0).await;
    let mut browser = block_in_place(|| Browser::open(desk.url()));
    let see = |browser: &mut Browser, expression: &str| block_in_place(|| browser.wait(expression, PATIENCE));
    see(&mut browser, "document.querySelectorAll('#robots > details').length === 3");

    // What lies between two is asked about, once there was a round and a second in which nobody asked.
    let began = Instant::now();
    let asks = "!document.querySelector('#question').hidden";
    while block_in_place(|| browser.evaluate(asks)) != json!(true) {
        assert!(began.elapsed() < PATIENCE, "{:?}", robots[0].robot.status());
        block_in_place(|| browser.press("#look"));
        tokio::time::sleep(Duration::from_millis(2500)).await;
    }
    println!("the question is shown {:?} after the first look", began.elapsed());
    let mut replies = block_in_place(|| browser.evaluate(REPLIES));
    replies.as_array_mut().unwrap()[..2].sort_by_key(Value::to_string);
    assert_eq!(replies, json!(["three fingers", "two fingers", "Neither"]));
    let words = block_in_place(|| browser.evaluate("document.querySelector('#asks').textContent"));
    let (asked, asker) = (words.as_str().unwrap().to_owned(), "robot 0 asks: ");
    assert!(asked.contains(asker) && asked.contains("two fingers") && asked.ends_with('?'), "{asked}");
    block_in_place(|| draw(&mut browser, "question"));

    let is_three = "[...document.querySelectorAll('#replies button')].findIndex(it => it.textContent === 'three fingers')";
    let place = block_in_place(|| browser.evaluate(is_three)).as_u64().unwrap() + 1;
    block_in_place(|| browser.press(&format!("#replies button:nth-child({place})")));
    see(&mut browser, "document.querySelector('#answer').textContent.includes('learned')");
    see(&mut browser, "document.querySelector('#question').hidden");
    see(&mut browser, "document.querySelector('#said').textContent.includes('it was three fingers')");
    for robot in &robots {
        let has =
            |learning: gestalt_protocol::LearningStatus| learning.personal[3] + learning.external[3] > 0;
        until(|| robot.robot.status().learning.is_some_and(has)).await;
    }

    // Something new is shown, and named with the round that shows it.
    shown.store(6, Ordering::Relaxed);
    let before = block_in_place(|| browser.evaluate("state.decision.round.counter"));
    block_in_place(|| browser.press("#look"));
    see(&mut browser, &format!("state.decision.round.counter > {before} && settled"));
    block_in_place(|| browser.evaluate("document.querySelector('#naming > summary').click()"));
    see(
        &mut browser,
        "document.querySelector('#naming').open && document.querySelector('#new').checkVisibility()",
    );
    block_in_place(|| {
        browser.evaluate("document.querySelector('#new-label').value = 'circle'");
        draw(&mut browser, "new-gesture");
        browser.press("#name-it");
    });
    see(&mut browser, "document.querySelector('#answer').textContent.includes('learned')");
    see(&mut browser, "document.querySelector('#gestures').textContent.includes('circle')");
    see(&mut browser, "document.querySelector('#said').textContent.includes('this is circle, a new one')");
    for robot in &robots {
        let knows = |learning: gestalt_protocol::LearningStatus| {
            learning.named.iter().any(|named| named.label == "circle" && named.samples > 0)
        };
        until(|| robot.robot.status().learning.is_some_and(knows)).await;
    }
    // It is one more button of "That was…".
    block_in_place(|| browser.evaluate("document.querySelector('#was > summary').click()"));
    see(&mut browser, "document.querySelectorAll('#gestures button').length === 7");
    block_in_place(|| draw(&mut browser, "named"));
    let complaints = block_in_place(|| browser.complaints());
    assert!(complaints.is_empty(), "{complaints:#?}");
    block_in_place(|| drop(browser));
    desk.close().await;
    for robot in robots {
        robot.stop().await;
    }
}

async fn until(mut is: impl FnMut() -> bool) {
    let deadline = Instant::now() + PATIENCE;
    while !is() {
        assert!(Instant::now() < deadline, "not within {PATIENCE:?}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}
