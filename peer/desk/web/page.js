"use strict";
// What the robots say is written as text, never as HTML: see `textContent` throughout, and the page's security policy.

const $ = (id) => document.getElementById(id);
// A number and its unit stay on one line.
const percent = (p) => (p >= 0.9995 ? "100\u00a0%" : `${(100 * p).toFixed(1)}\u00a0%`);
const counted = (n, what) => `${n} ${what}${n === 1 ? "" : "s"}`;
const token = decodeURIComponent(location.hash.slice(1));
const authority = token ? { Authorization: `Bearer ${token}` } : {};

const state = { swarm: null, decision: null, rounds: null, question: null };
// The round of which something was said last, here: what "Undo" takes back, whatever was decided since.
let said = null;
// Without a word for this long, the page is not live. The server says one each second.
const SILENCE = 2500;
// A round that has just appeared is not yet what the person meant to speak of.
const SETTLES = 400;
let heard = 0;
let live = false;
let why = "";
let since = new Date();
let settled = true;
let settling;
let waiting = false;

function text(id, words) {
  if ($(id).textContent !== words) $(id).textContent = words;
}

function make(tag, kind, words) {
  const it = document.createElement(tag);
  if (kind) it.className = kind;
  if (words !== undefined) it.textContent = words;
  return it;
}

function draw(tag, attributes, words) {
  const it = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) it.setAttribute(name, value);
  if (words !== undefined) it.textContent = words;
  return it;
}

// Makes the children of `parent` those of `items`, and no others, keeping those that are there: what is open or has the
// focus stays so.
function sync(parent, items, key, create, update) {
  const known = new Map([...parent.children].map((child) => [child.dataset.key, child]));
  const placed = new Set();
  let place = parent.firstElementChild;
  for (const item of items) {
    const name = String(key(item));
    let child = known.get(name);
    if (child) known.delete(name);
    else (child = create(item)).dataset.key = name;
    update(child, item);
    placed.add(child);
    if (child === place) place = place.nextElementSibling;
    else parent.insertBefore(child, place);
  }
  for (const child of [...parent.children]) if (!placed.has(child)) child.remove();
}

function put(child, words) {
  if (child.textContent !== words) child.textContent = words;
}

// ---- The decision and its reasons

function bar() {
  const row = make("div");
  const track = make("span", "track");
  track.append(make("div", "fill"));
  row.append(make("span", "who"), track, make("span", "what"));
  return row;
}

function fill(row, who, p, what, agrees) {
  const [name, track, words] = row.children;
  put(name, who);
  name.title = who;
  track.firstElementChild.style.width = `${Math.min(1, Math.max(0, p)) * 100}%`;
  put(words, what);
  words.title = what;
  row.className = agrees ? "" : "no";
}

function name(robot) {
  const known = state.swarm && state.swarm.robots.find((it) => it.id === robot);
  return known && known.name ? `${robot} ${known.name}` : `robot ${robot}`;
}

function showDecision() {
  const it = state.decision;
  for (const id of ["votes", "votes-title", "save"]) $(id).hidden = !it;
  if (!it) {
    text("gesture", "–");
    text("facts", "Nothing decided yet. Hold a gesture in front of the robots and press Look.");
    text("quorum", "Each robot’s vote will stand here.");
    text("others", "");
    $("shares").replaceChildren();
    return;
  }
  const label = it.label ?? it.outcome;
  text("gesture", label);
  $("gesture").classList.toggle("long", [...label].length > 12);
  const sure = it.label === null ? "" : `${percent(it.confidence)} sure · ${it.final ? "final" : "not final yet"} · `;
  const there = state.swarm ? state.swarm.robots.length : it.robots;
  const why = it.label === null && it.why ? `${it.why} · ` : "";
  text("facts", `${sure}${why}held by ${it.held} of ${there} · round ${it.round.counter}, ${it.elapsed_ms}\u00a0ms`);
  const against = it.votes.filter((vote) => !vote.agrees);
  const dissent = it.label === null ? "" : against.length === 0 ? ", all agree" : `, ${against.length} for something else`;
  text("quorum", `${it.reached} of ${counted(it.robots, "robot")} took part, ${it.quorum} needed · ` +
    `${counted(it.votes.length, "vote")} counted${dissent} · ${it.rule.replaceAll("_", "-")}`);
  const shares = it.shares.map((share, k) => ({ ...share, k })).sort((a, b) => b.probability - a.probability).slice(0, 6);
  sync($("shares"), shares, (share) => share.k, bar, (row, share) => {
    fill(row, share.label, share.probability, percent(share.probability), true);
  });
  // Of many, those who disagree are the first to be seen.
  const votes = it.votes.length > 12 ? [...it.votes].sort((a, b) => a.agrees - b.agrees) : it.votes;
  sync($("votes"), votes, (vote) => vote.robot, bar, (row, vote) => {
    const mark = it.label === null || vote.agrees ? "" : "≠ ";
    fill(row, name(vote.robot), vote.probability, `${mark}“${vote.label}” ${percent(vote.probability)}`, !mark);
  });
  const blind = it.others.length === 0 ? "" : `Took part without being counted, for they saw nothing or know other gestures: ${it.others.join(", ")}.`;
  text("others", blind);
}

function showVerdict() {
  const round = state.decision && state.rounds && state.rounds.rounds.find((it) => same(it.round, state.decision.round));
  const verdict = round ? round.verdict : "unknown";
  const words = {
    unknown: "", right: "✓ Right, says the instructor",
    wrong: round && round.truth ? `✗ Wrong: it was ${round.truth}` : "✗ Wrong, says the instructor",
  }[verdict];
  $("verdict").hidden = !words;
  $("verdict").className = `verdict ${verdict}`;
  text("verdict", words);
}

const same = (a, b) => a.counter === b.counter && a.opener === b.opener && a.life === b.life;

// ---- Robots

const TROUBLED = ["frozen", "failing", "ended"];

function kind(robot) {
  const camera = robot.camera.state;
  const own = TROUBLED.includes(camera) ? "bad" : camera === "live" ? "live" : "";
  return robot.answers ? own : `${own} silent`;
}

function dissenters() {
  const it = state.decision;
  return new Set(it && it.label !== null ? it.votes.filter((vote) => !vote.agrees).map((vote) => vote.robot) : []);
}

function showRing() {
  const robots = state.swarm.robots;
  const [n, centre, radius] = [robots.length, 200, n_radius(robots.length)];
  const size = Math.max(3, Math.min(24, 380 / Math.max(n, 1)));
  const spot = new Map(robots.map((robot, k) => {
    const angle = (2 * Math.PI * k) / n - Math.PI / 2;
    return [robot.id, [centre + radius * Math.cos(angle), centre + radius * Math.sin(angle), angle]];
  }));
  const links = new Set();
  for (const robot of robots) {
    for (const other of robot.links) {
      if (spot.has(other)) links.add(`${Math.min(robot.id, other)} ${Math.max(robot.id, other)}`);
    }
  }
  const lines = [...links].map((link) => {
    const [[x1, y1], [x2, y2]] = link.split(" ").map((id) => spot.get(Number(id)));
    return draw("line", { x1, y1, x2, y2 });
  });
  const against = dissenters();
  const dots = robots.map((robot) => {
    const [x, y, angle] = spot.get(robot.id);
    const group = draw("g", { class: `${kind(robot)} ${against.has(robot.id) ? "dissents" : ""}` });
    group.append(draw("title", {}, `robot ${robot.id} ${robot.name}`), draw("circle", { cx: x, cy: y, r: size }));
    if (n <= 40) group.append(draw("text", { x, y, "font-size": Math.min(17, size) }, String(robot.id)));
    const opinion = robot.camera.opinion;
    if (n <= 16 && opinion) {
      const far = radius + size + 12;
      const side = Math.cos(angle) > 0.3 ? "east" : Math.cos(angle) < -0.3 ? "west" : "";
      const words = [...opinion.gesture].length > 8 ? `${[...opinion.gesture].slice(0, 7).join("")}…` : opinion.gesture;
      group.append(draw("text", { class: `opinion ${side}`, x: centre + far * Math.cos(angle), y: centre + far * Math.sin(angle) }, words));
    }
    group.addEventListener("click", () => open(robot.id));
    return group;
  });
  $("ring").replaceChildren(...lines, ...dots);
  $("legend").hidden = n === 0;
  $("beside").hidden = n > 16;
  $("ring").setAttribute("aria-label", `${counted(n, "robot")} on a ring, ${counted(links.size, "link")}`);
  const silent = robots.filter((robot) => !robot.answers).length;
  const bad = robots.filter((robot) => TROUBLED.includes(robot.camera.state)).length;
  text("count", n === 0 ? "None heard yet." : [
    counted(n, "robot"), counted(links.size, "link"),
    bad ? `${counted(bad, "camera")} with trouble` : "", silent ? `${silent} not answering` : "",
  ].filter(Boolean).join(" · "));
}

const n_radius = (n) => (n <= 16 ? 142 : 182);

function open(id) {
  const row = [...$("robots").children].find((child) => child.dataset.key === String(id));
  if (row) {
    row.open = true;
    row.scrollIntoView({ block: "nearest" });
  }
}

function robotRow() {
  const row = make("details");
  const summary = make("summary");
  summary.append(make("span", "id"), make("span", "name"), make("span", "state"), make("span", "opinion"));
  row.append(summary, make("dl"));
  return row;
}

function showRobot(row, robot) {
  const { camera, learning } = robot;
  row.className = kind(robot);
  const [id, who, how, opinion] = row.firstElementChild.children;
  put(id, String(robot.id));
  put(who, robot.name || "…");
  put(how, robot.answers ? (camera.state === "none" ? "no camera" : camera.state) : "no answer");
  put(opinion, camera.opinion ? `“${camera.opinion.gesture}” ${Math.round(100 * camera.opinion.probability)} %` : "–");
  const facts = [
    ["Camera", `${camera.source}${camera.size[0] ? `, ${camera.size[0]} × ${camera.size[1]}` : ""}` +
      (camera.fps ? `, ${camera.fps.toFixed(1)} frames/s, judged after ${camera.delay_ms.toFixed(0)} ms` : "")],
    ["Trouble", camera.trouble],
    ["Motion", camera.motion ? camera.motion.state : ""],
    ["Classifier", robot.model],
    ["Links", robot.links.join(", ") || "none"],
    ["Hears", counted(robot.alive, "robot")],
    ["Samples", learning ? `${learning.personal} personal, ${learning.shared} shared, ${learning.external} external, at most ` +
      `${learning.capacity}; trained ${learning.trainings} times` : ""],
    ["Doubts", learning ? learning.doubted.map((it) => `robot ${it.robot}: trains on ${it.trained} of its ${counted(it.held, "sample")}`).join(", ") : ""],
    ["Memory", learning ? learning.memory : ""],
    ["Started", `${counted(robot.boot, "time")}${robot.sealed ? ", signs what it says" : ""}`],
  ].filter(([, words]) => words);
  sync(row.lastElementChild, facts.flatMap(([what, words]) => [["dt", what, what], ["dd", what, words]]),
    ([tag, what]) => tag + what, ([tag]) => make(tag), (child, [, , words]) => put(child, words));
}

function showProblems() {
  const all = state.swarm.robots.flatMap((robot) => {
    const camera = TROUBLED.includes(robot.camera.state) && robot.camera.trouble ? [`camera ${robot.camera.state}: ${robot.camera.trouble}`] : [];
    const silent = robot.answers ? [] : ["does not answer: see that its process runs and is not stopped"];
    const errors = [...new Set(robot.errors.map((error) => error.what))].reverse().slice(0, 3);
    return [...silent, ...camera, ...errors.filter((what) => what !== robot.camera.trouble)].map((what) => ({ robot: robot.id, what }));
  }).slice(0, 50);
  lines("errors", "no-errors", all, (it) => `${it.robot} ${it.what}`, (it) => [`Robot ${it.robot}`, it.what]);
}

function lines(list, none, items, key, words) {
  sync($(list), items, key, () => {
    const line = make("li");
    line.append(make("b"), make("span"));
    return line;
  }, (line, item) => {
    const [head, rest] = words(item);
    put(line.children[0], head);
    put(line.children[1], rest);
  });
  $(none).hidden = items.length > 0;
}

// ---- Rounds

const MARKS = { right: "✓", wrong: "✗", unknown: "·" };

function showRounds() {
  const { rounds, curve, said } = state.rounds;
  $("no-rounds").hidden = rounds.length > 0;
  sync($("rounds"), rounds.slice(-48), (it) => `${it.round.counter}@${it.round.opener}-${it.round.life}`, () => {
    const cell = make("li");
    cell.append(make("b"), make("i"));
    return cell;
  }, (cell, it) => {
    cell.className = it.verdict;
    put(cell.children[0], it.label ?? "–");
    put(cell.children[1], MARKS[it.verdict]);
    const verdict = { right: "right", wrong: it.truth ? `wrong, it was ${it.truth}` : "wrong", unknown: "not judged" }[it.verdict];
    cell.title = `round ${it.round.counter}: ${it.label ?? it.outcome ?? "undecided"}, ${percent(it.confidence)}, ${verdict}`;
  });
  showCurve(curve.slice(-120));
  const told = { open: () => "look", was: (it) => `it was ${it.gesture}`, right: () => "right", wrong: () => "wrong", retract: () => "took it back",
    new: (it) => (it.round ? `this is ${it.gesture}, a new one` : `${it.gesture} is a new one`), same: (it) => `${it.gesture} is ${it.of}`,
    retire: (it) => `${it.gesture} is shown no more`, restore: (it) => `${it.gesture} is in use again` };
  lines("said", "no-said", said.slice(0, 6), (it) => `${it.instructor} ${it.at}`, (it) => [
    it.round ? `${it.instructor}, round ${it.round.counter}` : it.instructor, `“${told[it.word](it)}” → ${it.words}`,
  ]);
}

function showCurve(curve) {
  const last = curve.at(-1);
  $("curve").toggleAttribute("hidden", curve.length < 2);
  text("curve-words", last
    ? `Of the latest rounds that were judged, a single robot is right in ${Math.round(100 * last.single)}\u00a0%, the swarm in ${Math.round(100 * last.swarm)}\u00a0%.`
    : "It begins when somebody says which gesture was shown.");
  if (curve.length < 2) return;
  const [left, right, top, bottom] = [72, 530, 14, 200];
  const x = (k) => left + ((right - left) * k) / (curve.length - 1);
  const y = (p) => bottom - (bottom - top) * p;
  const grid = [0, 0.5, 1].flatMap((p) => [
    draw("line", { x1: left, x2: right, y1: y(p), y2: y(p) }),
    draw("text", { x: left - 10, y: y(p) + 5, "text-anchor": "end" }, `${100 * p} %`),
  ]);
  const line = (which) => draw("polyline", { class: which, points: curve.map((it, k) => `${x(k)},${y(it[which])}`).join(" ") });
  // Two labels never lie on each other.
  let [swarm, single] = [y(last.swarm), y(last.single)];
  if (Math.abs(swarm - single) < 22) {
    const [middle, sign] = [Math.min(bottom - 10, Math.max(top + 10, (swarm + single) / 2)), swarm <= single ? 1 : -1];
    [swarm, single] = [middle - 11 * sign, middle + 11 * sign];
  }
  $("curve").replaceChildren(...grid, line("single"), line("swarm"),
    draw("text", { class: "swarm", x: right + 12, y: swarm + 5 }, "swarm"),
    draw("text", { class: "single", x: right + 12, y: single + 5 }, "one robot"),
    draw("text", { x: left, y: 230 }, `round ${curve[0].round}`),
    draw("text", { x: right, y: 230, "text-anchor": "end" }, `round ${last.round}`));
  $("curve").setAttribute("aria-label", `Learning curve over ${counted(curve.length, "judged round")}: ${$("curve-words").textContent}`);
}

// ---- Talking to the swarm

function buttons() {
  const it = state.decision;
  const can = live && settled && !waiting;
  $("look").disabled = !live || waiting;
  for (const id of ["right", "wrong"]) $(id).disabled = !can || !it || it.class === null;
  $("undo").disabled = !can || !(said || it);
  $("name-it").disabled = !live || waiting;
  $("was").classList.toggle("off", !can || !it);
  for (const button of $("gestures").children) button.disabled = !can || !it;
  for (const button of $("replies").children) button.disabled = !live || waiting;
}

function showGestures() {
  sync($("gestures"), state.swarm.vocabulary, (label) => label, (label) => {
    const button = make("button", "", label);
    button.type = "button";
    button.addEventListener("click", () => {
      $("was").open = false;
      say({ say: "was", round: state.decision.round, class: meant(label) });
    });
    return button;
  }, () => {});
}

// The gesture that is shown under a label: of those that were named it is that one, whoever else named another so.
function meant(label) {
  const k = state.swarm ? state.swarm.vocabulary.indexOf(label) : -1;
  return k < 0 ? label : state.swarm.gestures[k];
}

// A question is answered with a word on its round, whatever was decided since. "Neither" leaves it to "That was…" to say which.
function showQuestion() {
  const it = state.question;
  $("question").hidden = !it;
  if (!it) return;
  text("asks", `Round ${it.round.counter}, robot ${it.robot} asks: ${it.words}`);
  const known = state.swarm ? state.swarm.vocabulary : [];
  const asked = it.kind === "again" ? [] : it.kind === "between" ? it.gestures : known;
  const gestures = asked.map((label, k) => ({ label, answer: it.kind === "between" ? it.answers[k] : meant(label) }));
  const neither = it.kind === "between" ? known.filter((label) => !it.gestures.includes(label)) : [];
  const replies = neither.length > 0 ? [...gestures, { label: "Neither", of: neither }] : gestures;
  sync($("replies"), replies, (reply) => JSON.stringify([it.round, reply]), (reply) => {
    const button = make("button", "", reply.label);
    button.type = "button";
    button.addEventListener("click", () => {
      if (reply.of) chooseOther(it, reply.of);
      else say({ say: "was", round: it.round, class: reply.answer });
    });
    return button;
  }, () => {});
  buttons();
}

// Neither of the two: then which of the others.
function chooseOther(it, others) {
  const replies = others.map((label) => {
    const button = make("button", "", label);
    button.type = "button";
    button.addEventListener("click", () => say({ say: "was", round: it.round, class: meant(label) }));
    return button;
  });
  $("replies").replaceChildren(...replies);
  buttons();
}

// What is answered to words that are no refusals.
const HEEDED = ["learned", "known", "nothing_seen"];

// Says it, with `before` in front of what comes of it. Gives whether the swarm heeds it.
async function say(word, before = "") {
  let heeded = false;
  waiting = true;
  // Also what nobody answers may have arrived.
  said = word.round ?? said;
  buttons();
  reply(word.say === "open" ? "Asking all robots to look…" : "Telling the swarm…", false);
  try {
    const response = await fetch("say", {
      method: "POST", headers: { ...authority, "Content-Type": "application/json" }, body: JSON.stringify(word),
    });
    const told = await response.json();
    if (!response.ok) throw new Error(told.error);
    const samples = told.answer ? `; robot ${told.answer.robot} learns from ${counted(told.answer.samples, "sample")} of it` : "";
    const round = word.round ? `Round ${word.round.counter}: ` : "";
    const words = round + told.words + (told.answer && told.answer.samples ? samples : "");
    reply(`${before}${words[0].toUpperCase()}${words.slice(1)}.`, false);
    heeded = !told.answer || HEEDED.includes(told.answer.outcome);
  } catch (error) {
    reply(`${before}That did not arrive: ${error.message}`, true);
  }
  waiting = false;
  buttons();
  return heeded;
}

// Names a gesture, and then says that the round shown last showed it, unless somebody has said which gesture that did.
async function nameNew(label) {
  const round = settled && state.decision ? state.decision.round : null;
  if (!(await say({ say: "new", label })) || !round) return;
  const known = state.rounds && state.rounds.rounds.find((it) => same(it.round, round));
  if (known && known.truth !== null) reply(`“${label}” is named. Round ${round.counter} was ${known.truth}, somebody has said.`, false);
  else await say({ say: "new", label, round }, `“${label}” is named. `);
}

function reply(words, failed) {
  text("answer", words);
  $("answer").classList.toggle("failed", failed);
}

async function save() {
  try {
    const response = await fetch("decision.json", { headers: authority });
    if (!response.ok) throw new Error(await response.text());
    const link = make("a");
    link.href = URL.createObjectURL(await response.blob());
    link.download = `decision-${state.decision.round.counter}.json`;
    link.click();
    URL.revokeObjectURL(link.href);
  } catch (error) {
    reply(`The decision cannot be saved: ${error.message}`, true);
  }
}

// ---- What the server says

const PARTS = {
  swarm(it) {
    state.swarm = it;
    $("trouble").hidden = !it.trouble;
    text("trouble", it.trouble ?? "");
    showGestures();
    sync($("robots"), it.robots, (robot) => robot.id, robotRow, showRobot);
    showRing();
    showProblems();
    showDecision();
  },
  decision(it) {
    const changed = it && !(state.decision && same(it.round, state.decision.round));
    state.decision = it;
    if (changed) {
      settled = false;
      reply("", false);
      clearTimeout(settling);
      settling = setTimeout(() => { settled = true; buttons(); }, SETTLES);
    }
    showDecision();
    showVerdict();
    if (state.swarm) showRing();
  },
  rounds(it) {
    state.rounds = it;
    showRounds();
    showVerdict();
  },
  question(it) {
    const changed = JSON.stringify(it) !== JSON.stringify(state.question);
    state.question = it;
    if (changed) showQuestion();
  },
  beat(it) {
    text("swarm", it.swarm);
    document.title = `${it.swarm} · Gestalt`;
  },
};

function is(now) {
  if (now !== live) since = new Date();
  live = now;
  document.body.classList.toggle("stale", !now);
  $("live").className = `pulse ${now ? "yes" : "no"}`;
  text("live", now ? "Live" : "Not live");
  $("lost").hidden = now;
  if (!now) text("lost", `Not live since ${since.toLocaleTimeString()}. ${why || "What you see has stopped; the page keeps trying to reach its server."}`);
  buttons();
}

// What is wrong with one part costs that part. Only line feeds end lines here: a text may have other separators in it.
function take(event) {
  const [, name, data] = event.match(/^event: (\w+)\ndata: ([^\n]*)$/) ?? [];
  try {
    if (name in PARTS) PARTS[name](JSON.parse(data));
  } catch (error) {
    console.error(`cannot show "${name}":`, error);
  }
  buttons();
}

// A stream of events that is read by hand, for it has to carry the token.
async function listen(signal) {
  const response = await fetch("events", { headers: authority, cache: "no-store", signal });
  if (!response.ok) throw Object.assign(new Error(), { words: (await response.text()).trim() });
  const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
  for (let text = "";;) {
    const { value, done } = await reader.read();
    if (done) return;
    heard = performance.now();
    text += value;
    const events = text.split("\n\n");
    text = events.pop();
    events.forEach(take);
    if (!live) is(true);
  }
}

async function follow() {
  for (;;) {
    const stop = new AbortController();
    heard = performance.now();
    const watchdog = setInterval(() => { if (performance.now() - heard > SILENCE) stop.abort(); }, 250);
    why = "";
    try {
      await listen(stop.signal);
    } catch (error) {
      why = error.words ?? "";
    }
    clearInterval(watchdog);
    is(false);
    await new Promise((done) => setTimeout(done, 1000));
  }
}

$("look").addEventListener("click", () => say({ say: "open" }));
for (const word of ["right", "wrong"]) {
  $(word).addEventListener("click", () => say({ say: word, round: state.decision.round, of: state.decision.class }));
}
$("new").addEventListener("submit", (event) => {
  event.preventDefault();
  const label = $("new-label").value.trim();
  if (!label) return;
  $("new-label").value = "";
  $("naming").open = false;
  nameNew(label);
});
$("undo").addEventListener("click", () => say({ say: "retract", round: said ?? state.decision.round }));
$("certificate").addEventListener("click", save);
addEventListener("hashchange", () => location.reload());
follow();
