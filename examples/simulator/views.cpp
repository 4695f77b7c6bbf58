#include "views.hpp"

#include <cmath>
#include <fstream>
#include <limits>
#include <sstream>
#include <stdexcept>

namespace gestalt {

namespace {

constexpr double DEGREES = 180.0 / 3.14159265358979323846;
/// Whoever stands further from every place than this sees nothing.
constexpr double FAR_DEG = 12.0;
constexpr double FAR_M = 0.3;
/// More lines than `gestalt views` writes.
constexpr std::size_t MOST_LINES = 1'000'000;

struct Line {
  std::size_t hand;
  Place place;
  int gesture;
  std::size_t frame;
  std::optional<Eye::Look> look;
};

std::runtime_error wrong(const std::string& path, std::size_t line, const std::string& why) {
  return std::runtime_error(path + ", line " + std::to_string(line) + ": " + why + "; write it again with `gestalt views`");
}

double number(const std::string& text) {
  std::size_t read = 0;
  const double value = std::stod(text, &read);
  if (read != text.size() || !std::isfinite(value)) throw std::invalid_argument(text);
  return value;
}

Line parse(const std::string& text, std::size_t features) {
  std::vector<std::string> fields;
  std::istringstream stream(text);
  for (std::string field; std::getline(stream, field, ',');) fields.push_back(field);
  // After the last comma there may be nothing: no hand.
  if (fields.size() < 5) throw std::invalid_argument("too few fields");
  Line line{};
  line.hand = static_cast<std::size_t>(number(fields[0]));
  line.place = {number(fields[1]), number(fields[2])};
  line.gesture = static_cast<int>(number(fields[3]));
  line.frame = static_cast<std::size_t>(number(fields[4]));
  if (fields.size() > 5) {
    if (fields.size() != 6 + features) throw std::invalid_argument("another number of features than its heading");
    Eye::Look look;
    look.quality = static_cast<float>(number(fields[5]));
    for (std::size_t i = 6; i < fields.size(); ++i) look.features.push_back(static_cast<float>(number(fields[i])));
    line.look = std::move(look);
  }
  return line;
}

}  // namespace

Place place_of(double x, double y) { return {std::atan2(x, y) * DEGREES, std::hypot(x, y)}; }

Views::Views(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error(path + " cannot be read: write it with `gestalt views --out " + path + "`");
  std::string text;
  if (!std::getline(file, text) || text.rfind("hand,bearing_deg,distance_m,gesture,frame,quality,f0", 0) != 0) {
    throw wrong(path, 1, "this is no table of views");
  }
  for (const char c : text) features_ += c == ',';
  features_ -= 5;
  std::vector<Line> lines;
  while (std::getline(file, text)) {
    if (lines.size() == MOST_LINES) throw wrong(path, lines.size() + 2, "too many lines");
    try {
      lines.push_back(parse(text, features_));
    } catch (const std::logic_error& error) {
      throw wrong(path, lines.size() + 2, std::string("not a view: ") + error.what());
    }
  }
  // Lines come hand by hand, place by place, gesture by gesture, frame by frame: the last one says how many there are of each.
  if (lines.empty()) throw wrong(path, 2, "there are no views");
  hands_ = lines.back().hand + 1;
  gestures_ = lines.back().gesture + 1;
  frames_ = lines.back().frame + 1;
  const std::size_t per_place = static_cast<std::size_t>(gestures_) * frames_;
  if (lines.size() % (hands_ * per_place) != 0) throw wrong(path, lines.size() + 1, "it is cut short");
  for (std::size_t i = 0; i < lines.size() / hands_; i += per_place) places_.push_back(lines[i].place);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const Line& line = lines[i];
    const std::size_t place = i / per_place % places_.size();
    const bool there = line.place.bearing_deg == places_[place].bearing_deg &&
                       line.place.distance_m == places_[place].distance_m;
    if (!there || line.gesture < 0 || row(line.hand, place, line.gesture, line.frame) != i) {
      throw wrong(path, i + 2, "it is out of order");
    }
    looks_.push_back(line.look);
  }
}

std::size_t Views::row(std::size_t hand, std::size_t place, int gesture, std::size_t frame) const {
  return ((hand * places_.size() + place) * static_cast<std::size_t>(gestures_) + static_cast<std::size_t>(gesture)) *
             frames_ +
         frame;
}

std::optional<Eye::Look> Views::look(std::size_t hand, int gesture, Place from, std::size_t frame) const {
  if (hand >= hands_ || gesture < 0 || gesture >= gestures_ || frame >= frames_) return std::nullopt;
  double least = std::numeric_limits<double>::max();
  std::size_t nearest = 0;
  for (std::size_t i = 0; i < places_.size(); ++i) {
    const double bearing = std::abs(places_[i].bearing_deg - from.bearing_deg);
    const double distance = std::abs(places_[i].distance_m - from.distance_m);
    if (bearing > FAR_DEG || distance > FAR_M) continue;
    const double away = bearing / FAR_DEG + distance / FAR_M;
    if (away < least) {
      least = away;
      nearest = i;
    }
  }
  if (least == std::numeric_limits<double>::max()) return std::nullopt;
  return looks_[row(hand, nearest, gesture, frame)];
}

}  // namespace gestalt
