// Ten marXbots of Enki around a human: they drive somewhere, look at a hand, and decide over a radio of limited range.
//
// Prints a line of CSV for each showing; --trace FILE says all that happened, the same for the same seed, byte for byte.
#include <enki/PhysicalEngine.h>
#include <enki/robots/marxbot/Marxbot.h>

#include <array>
#include <cinttypes>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <map>
#include <memory>
#include <numeric>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "drive.hpp"
#include "human.hpp"
#include "robot.hpp"

namespace {

using namespace gestalt;

constexpr std::size_t MOST_ROBOTS = 32;
constexpr std::uint64_t STEP = 20'000'000;
constexpr double STEP_S = 0.02;
constexpr double CM = 100;

struct Options {
  std::string views, model, trace;
  std::vector<double> ranges{5};
  std::size_t robots = 10, packet = 64;
  std::uint64_t showings = 20, seed = 1;
  double loss = 0.02;
};

/// Where the robots of a showing go: before the human, none too near to another.
std::vector<Enki::Point> places(const Options& options, std::uint64_t showing) {
  Chance chance(options.seed ^ 0x9aceULL, showing);
  std::vector<Enki::Point> places;
  double apart = 0.3 * CM;
  while (places.size() < options.robots) {
    const double bearing = chance.between(-75, 75) * 3.14159265358979323846 / 180, away = chance.between(0.6, 1.2) * CM;
    const Enki::Point place(away * std::sin(bearing), away * std::cos(bearing));
    bool free = true;
    for (const Enki::Point& other : places) free = free && (place - other).norm() > apart;
    if (free) places.push_back(place);
    // A full room: they stand closer, down to touching.
    apart = std::max(0.18 * CM, apart * 0.999);
  }
  return places;
}

/// What Enki moves. One piece of memory, for Enki goes through its objects by their addresses: so their order is always the same.
struct Stage {
  Enki::PhysicalObject human;
  std::array<Enki::Marxbot, MOST_ROBOTS> marxbots;
};

class Simulation {
 public:
  Simulation(const Options& options, const Views& views, double range, std::FILE* trace)
      : options_(options),
        range_(range),
        trace_(trace),
        human_(options.seed, views.hands(), views.gestures()),
        stage_(std::make_unique<Stage>()),
        chance_(options.seed, 0x4ad10) {
    // Enki draws its motors' noise from these two.
    std::srand(static_cast<unsigned>(options.seed));
    world_.setRandomSeed(options.seed);
    world_.takeObjectOwnership = false;
    stage_->human.setCylindric(20, 170, -1);
    // The palm is at the origin, the human behind it.
    stage_->human.pos = Enki::Point(0, -45);
    world_.addObject(&stage_->human);
    const auto start = places(options, 0);
    for (std::size_t i = 0; i < options.robots; ++i) {
      marxbot(i).pos = start[i];
      marxbot(i).angle = 0;
      world_.addObject(&marxbot(i));
      RobotConfig config;
      config.id = static_cast<std::uint32_t>(i + 1);
      config.seed = options.seed;
      config.model = options.model;
      config.packet_bytes = options.packet;
      robots_.push_back(std::make_unique<Robot>(config));
      eyes_.push_back(std::make_unique<DrawnEye>(views, human_, options.seed, config.id));
    }
  }

  ~Simulation() {
    while (!world_.objects.empty()) world_.objects.erase(world_.objects.begin());
  }

  /// Runs all showings; whether every robot that was in reach of the largest group agreed is for the reader to judge.
  void run() {
    std::vector<Enki::Point> targets;
    for (std::uint64_t now = 0; now < options_.showings * Human::PERIOD; now += STEP) {
      const std::uint64_t showing = Human::showing_at(now);
      if (Human::into(now) == 0) targets = places(options_, showing);
      move(now, targets);
      deliver(now);
      for (std::size_t i = 0; i < robots_.size(); ++i) {
        eyes_[i]->stands_at(place_of(marxbot(i).pos.x / CM, marxbot(i).pos.y / CM));
        robots_[i]->step(now, *eyes_[i]);
      }
      transmit(now);
      if (Human::into(now + STEP) == 0) report(showing);
    }
  }

 private:
  struct Packet {
    std::size_t to;
    Bytes bytes;
  };

  Enki::Marxbot& marxbot(std::size_t i) { return stage_->marxbots[i]; }

  void move(std::uint64_t now, const std::vector<Enki::Point>& targets) {
    for (std::size_t i = 0; i < robots_.size(); ++i) {
      Wheels wheels;
      const Enki::Point at = marxbot(i).pos;
      if (Human::into(now) < Human::MOVING) {
        wheels = drive(at.x / CM, at.y / CM, marxbot(i).angle, targets[i].x / CM, targets[i].y / CM);
      }
      marxbot(i).leftSpeed = wheels.left * CM;
      marxbot(i).rightSpeed = wheels.right * CM;
    }
    world_.step(STEP_S);
    if (trace_ && now % 1'000'000'000 == 0) {
      for (std::size_t i = 0; i < robots_.size(); ++i) {
        // All digits: a trace that rounds could hide a difference.
        const Enki::Marxbot& bot = marxbot(i);
        std::fprintf(trace_, "%" PRIu64 " %zu at %a %a %a\n", now, i + 1, bot.pos.x, bot.pos.y, bot.angle);
      }
    }
  }

  /// What was sent in the step before arrives now.
  void deliver(std::uint64_t now) {
    for (const Packet& packet : air_) robots_[packet.to]->hear(now, packet.bytes.data(), packet.bytes.size());
    air_.clear();
  }

  void transmit(std::uint64_t now) {
    for (std::size_t i = 0; i < robots_.size(); ++i) {
      const Bytes packet = robots_[i]->send(now);
      if (packet.empty()) continue;
      if (trace_) {
        std::fprintf(trace_, "%" PRIu64 " %zu sends ", now, i + 1);
        for (const std::uint8_t byte : packet) std::fprintf(trace_, "%02x", byte);
        std::fputc('\n', trace_);
      }
      for (std::size_t j = 0; j < robots_.size(); ++j) {
        if (j != i && hears(j, i) && chance_.between(0, 1) >= options_.loss) air_.push_back({j, packet});
      }
    }
  }

  bool hears(std::size_t i, std::size_t j) { return (marxbot(i).pos - marxbot(j).pos).norm() <= range_ * CM; }

  /// How many robots the largest group has that can reach each other, over others if need be.
  std::size_t reach() {
    std::vector<std::size_t> group(robots_.size());
    std::iota(group.begin(), group.end(), 0);
    for (bool merged = true; merged;) {
      merged = false;
      for (std::size_t i = 0; i < group.size(); ++i) {
        for (std::size_t j = 0; j < group.size(); ++j) {
          if (group[j] < group[i] && hears(i, j)) {
            group[i] = group[j];
            merged = true;
          }
        }
      }
    }
    std::map<std::size_t, std::size_t> sizes;
    std::size_t largest = 0;
    for (const std::size_t g : group) largest = std::max(largest, ++sizes[g]);
    return largest;
  }

  /// One line: how many hold the same decision of this showing, and which.
  void report(std::uint64_t showing) {
    const Human::Showing shown = human_.showing(showing);
    std::map<std::pair<std::string, int>, std::size_t> holders;
    std::set<std::string> rounds;
    for (std::size_t i = 0; i < robots_.size(); ++i) {
      const auto held = robots_[i]->held();
      if (!held) continue;
      rounds.insert(held->round);
      // What is held of an earlier showing is not of this one.
      if (held->gesture && !past_.count(held->round)) holders[{held->round, *held->gesture}] += 1;
      if (trace_) {
        std::fprintf(trace_, "showing %" PRIu64 ": %zu holds %s %d\n", showing, i + 1, held->round.c_str(),
                     held->gesture.value_or(-1));
      }
    }
    past_.insert(rounds.begin(), rounds.end());
    std::size_t agree = 0;
    int gesture = -1;
    for (const auto& [decision, count] : holders) {
      if (count > agree) {
        agree = count;
        gesture = decision.second;
      }
    }
    std::uint64_t packets = 0, refused = 0;
    for (const auto& robot : robots_) {
      packets += robot->radio().counters().packets;
      refused += robot->refused() + robot->radio().counters().garbage;
    }
    std::printf("%g,%" PRIu64 ",%d,%zu,%zu,%zu,%s,%d,%" PRIu64 ",%" PRIu64 "\n", range_, showing, shown.gesture, robots_.size(),
                reach(), agree, gesture < 0 ? "" : std::to_string(gesture).c_str(), gesture == shown.gesture, packets,
                refused);
    std::fflush(stdout);
  }

  const Options& options_;
  double range_;
  std::FILE* trace_;
  Human human_;
  Enki::World world_;
  std::unique_ptr<Stage> stage_;
  std::vector<std::unique_ptr<Robot>> robots_;
  std::vector<std::unique_ptr<DrawnEye>> eyes_;
  std::vector<Packet> air_;
  std::set<std::string> past_;
  Chance chance_;
};

const char USAGE[] =
    "usage: enki-swarm --views views.csv --model rendered.gestalt [--robots 10] [--showings 20] [--range 5 | --range 0.3,0.5,…]\n"
    "                  [--loss 0.02] [--packet 64] [--seed 1] [--trace FILE]\n";

Options parse(int count, char** words) {
  Options options;
  for (int i = 1; i < count; i += 2) {
    const std::string name = words[i];
    if (i + 1 == count) throw std::invalid_argument(name + " needs a value");
    const std::string value = words[i + 1];
    const auto within = [&](const std::string& text, double low, double high) {
      std::size_t read = 0;
      double parsed = 0;
      try {
        parsed = std::stod(text, &read);
      } catch (const std::logic_error&) {
      }
      if (text.empty() || read != text.size() || !(parsed >= low && parsed <= high)) {
        std::ostringstream why;
        why << name << " is " << text << ": choose a number from " << low << " to " << high;
        throw std::invalid_argument(why.str());
      }
      return parsed;
    };
    const auto number = [&](double low, double high) { return within(value, low, high); };
    if (name == "--views") options.views = value;
    else if (name == "--model") options.model = value;
    else if (name == "--trace") options.trace = value;
    else if (name == "--robots") options.robots = static_cast<std::size_t>(number(1, MOST_ROBOTS));
    else if (name == "--showings") options.showings = static_cast<std::uint64_t>(number(1, 10'000));
    else if (name == "--packet") options.packet = static_cast<std::size_t>(number(16, 4096));
    else if (name == "--seed") options.seed = static_cast<std::uint64_t>(number(0, 1e15));
    else if (name == "--loss") options.loss = number(0, 1);
    else if (name == "--range") {
      options.ranges.clear();
      for (std::size_t at = 0; at <= value.size();) {
        const std::size_t end = std::min(value.find(',', at), value.size());
        options.ranges.push_back(within(value.substr(at, end - at), 0, 1000));
        at = end + 1;
      }
    } else throw std::invalid_argument(name + " is no option");
  }
  if (options.views.empty() || options.model.empty()) throw std::invalid_argument("--views and --model are needed");
  return options;
}

}  // namespace

int main(int count, char** words) {
  try {
    Options options;
    try {
      options = parse(count, words);
    } catch (const std::invalid_argument& error) {
      std::fprintf(stderr, "enki-swarm: %s\n%s", error.what(), USAGE);
      return 2;
    }
    const Views views(options.views);
    std::FILE* trace = nullptr;
    if (!options.trace.empty()) {
      trace = std::fopen(options.trace.c_str(), "w");
      if (!trace) throw std::runtime_error("cannot write " + options.trace);
    }
    std::puts("range_m,showing,shown,robots,reach,agree,gesture,right,packets,refused");
    for (const double range : options.ranges) Simulation(options, views, range, trace).run();
    if (trace && std::fclose(trace) != 0) throw std::runtime_error("cannot write " + options.trace);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "enki-swarm: %s\n", error.what());
    return 1;
  }
}
