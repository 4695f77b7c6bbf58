//! What a proof may be made to look like.

use serde_json::{Value, json};

/// The part of a text from `from` to the first `to` after it, replaced.
fn between(text: &str, from: &str, to: &str, other: &str) -> String {
    let start = text.find(from).unwrap_or_else(|| panic!("{from} in {text}"));
    let end = start + text[start..].find(to).unwrap() + to.len();
    format!("{}{other}{}", &text[..start], &text[end..])
}

/// The same decision in other words, and in words that other readers would take for another one.
pub fn respelt(text: &str) -> Vec<(&'static str, Vec<u8>)> {
    let read: Value = serde_json::from_str(text).unwrap();
    let (class, counter) = (&read["class"], &read["round"]["counter"]);
    let nats = text.split_once("\"evidence\":[").unwrap().1.split_once(',').unwrap().0;
    let exact = format!("{:.60}", f64::from(nats.parse::<f32>().unwrap()));
    let beside = |more: &str| text.replacen('{', &format!("{{{more},"), 1);
    let evidence = |digits: &str| text.replacen(&format!("[{nats}"), &format!("[{digits}"), 1);
    let counted =
        |other: &str| text.replace(&format!("\"counter\":{counter},"), &format!("\"counter\":{other},"));
    let label = |other: &str| between(text, "\"label\":", ",", &format!("\"label\":{other},"));
    let signature = text.rsplit_once("\"signature\":\"").unwrap().1.trim_end_matches("\"}");
    let round = &read["round"];
    let texts = vec![
        ("itself", text.to_owned()),
        ("with more space", text.replace(',', " ,\n\t")),
        ("two million spaces", text.to_owned() + &" ".repeat(2 << 20)),
        ("a class before it", beside("\"class\":5")),
        ("its class twice", beside(&format!("\"class\":{class}"))),
        ("a field more", beside("\"more\":1")),
        ("a field more, twice", beside("\"more\":1,\"more\":2")),
        ("no number beside it", beside("\"more\":NaN")),
        ("no end beside it", beside("\"more\":-Infinity")),
        ("half a letter beside it", beside("\"more\":\"\\ud800\"")),
        ("a number without bounds beside it", beside("\"more\":1e999999")),
        ("depths beside it", beside(&format!("\"more\":{}{}", "[".repeat(5000), "]".repeat(5000)))),
        ("a field more in a vote", text.replacen("\"looks\"", "\"more\":null,\"looks\"", 1)),
        ("its names written otherwise", text.replace("\"final\"", "\"\\u0066inal\"")),
        ("digits in upper case", text.replace(signature, &signature.to_uppercase())),
        ("digits apart", text.replace(signature, &format!("{} {}", &signature[..64], &signature[64..]))),
        ("a digit less", text.replace(signature, &signature[1..])),
        (
            "1 for true",
            text.replace("\"final\":true", "\"final\":1").replace("\"final\":false", "\"final\":0"),
        ),
        ("true for 1", text.replace("\"opener\":1", "\"opener\":true")),
        ("a point", counted(&format!("{counter}.0"))),
        ("an exponent", counted(&format!("{counter}e0"))),
        ("a zero before it", counted(&format!("0{counter}"))),
        ("a sign", counted(&format!("+{counter}"))),
        ("less than nothing", counted("-0")),
        ("beyond its bounds", counted("4294967297")),
        ("far beyond its bounds", counted(&"9".repeat(5000))),
        ("a text", counted(&format!("\"{counter}\""))),
        ("all digits", evidence(&exact)),
        ("digits that are nobody's", evidence(&format!("{exact}0000000000000000000000000001"))),
        ("a little more than it", evidence(&format!("{}4", &exact[..exact.len() - 30]))),
        ("another float", evidence(&format!("1{nats}"))),
        ("beyond all floats", evidence("1e39")),
        ("nothing that is negative", evidence("-0")),
        ("more digits than there are", evidence(&format!("{exact}{}", "0".repeat(5000)))),
        ("no terms", between(text, "\"terms\":", "}", "\"x\":0").replace(",\"x\":0", "")),
        ("no named", text.replacen("\"named\":[],", "", 1)),
        ("no unknown", text.replacen("\"unknown\":null,", "", 1)),
        ("no pool", text.replacen("\"pool\":null,", "", 1)),
        ("no label", between(text, "\"label\":", ",", "")),
        ("another label", label("\"x\"")),
        ("half a letter", label("\"\\ud800\"")),
        ("a letter in two halves", label("\"\\ud83d\\udc4b\"")),
        ("a number for a label", label("7")),
        (
            "a round as a list",
            text.replacen(
                &round.to_string(),
                &json!([round["counter"], round["opener"], round["life"]]).to_string(),
                1,
            ),
        ),
        (
            "a rule as an object",
            text.replacen("\"rule\":\"", "\"rule\":{\"", 1).replacen("\",\"pool\"", "\":null},\"pool\"", 1),
        ),
        (
            "a rule of somebody's own",
            between(text, "\"rule\":\"", "\"", "\"rule\":{\"other\":\"mine\"}").replacen(
                "}correlated_pool\"",
                "}",
                1,
            ),
        ),
        ("one more", text.to_owned() + "{}"),
        ("half of it", text[..text.len() / 2].to_owned()),
        ("nothing", String::new()),
        ("a list", format!("[{text}]")),
        ("nobody", "null".to_owned()),
        ("a mark before it", format!("\u{feff}{text}")),
    ];
    let mut texts: Vec<(&str, Vec<u8>)> =
        texts.into_iter().map(|(what, text)| (what, text.into_bytes())).collect();
    let label = text.find("\"label\":").unwrap();
    texts.push((
        "no letter",
        [
            &text.as_bytes()[..label + 9],
            b"\"\xff\",\"announcer\":",
            text[label..].split_once("\"announcer\":").unwrap().1.as_bytes(),
        ]
        .concat(),
    ));
    texts.push(("sixteen bits a letter", text.encode_utf16().flat_map(u16::to_le_bytes).collect()));
    texts
}
