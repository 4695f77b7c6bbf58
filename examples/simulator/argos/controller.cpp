// The same robot as a foot-bot of ARGoS: its range-and-bearing radio carries the packets.
//
// Needs ARGoS 3 (https://www.argos-sim.info); see swarm.argos for the parameters, and ../README.md for what was run.
#include <argos3/core/control_interface/ci_controller.h>
#include <argos3/core/utility/configuration/argos_configuration.h>
#include <argos3/core/utility/logging/argos_log.h>
#include <argos3/plugins/robots/generic/control_interface/ci_differential_steering_actuator.h>
#include <argos3/plugins/robots/generic/control_interface/ci_positioning_sensor.h>
#include <argos3/plugins/robots/generic/control_interface/ci_range_and_bearing_actuator.h>
#include <argos3/plugins/robots/generic/control_interface/ci_range_and_bearing_sensor.h>

#include <algorithm>
#include <memory>
#include <string>

#include "../chance.hpp"
#include "../drive.hpp"
#include "../human.hpp"
#include "../robot.hpp"

namespace {

using namespace gestalt;

/// ARGoS wants wheels in centimetres a second.
constexpr double CM = 100;

class GestaltFootbot : public argos::CCI_Controller {
 public:
  void Init(argos::TConfigurationNode& node) override {
    try {
      wheels_ = GetActuator<argos::CCI_DifferentialSteeringActuator>("differential_steering");
      speaker_ = GetActuator<argos::CCI_RangeAndBearingActuator>("range_and_bearing");
      ears_ = GetSensor<argos::CCI_RangeAndBearingSensor>("range_and_bearing");
      place_ = GetSensor<argos::CCI_PositioningSensor>("positioning");
      std::string views;
      argos::UInt32 seed = 1, step_ms = 20;
      argos::GetNodeAttribute(node, "views", views);
      argos::GetNodeAttribute(node, "model", config_.model);
      argos::GetNodeAttributeOrDefault(node, "seed", seed, seed);
      argos::GetNodeAttributeOrDefault(node, "step_ms", step_ms, step_ms);
      argos::GetNodeAttributeOrDefault(node, "rounds", config_.rounds, config_.rounds);
      config_.seed = seed;
      step_ = step_ms * std::uint64_t{1'000'000};
      // The packets of this radio are all of one length: the first byte says how much of it is used.
      config_.packet_bytes = std::min<std::size_t>(speaker_->GetSize() - 1, 0xff);
      // Robots are called fb0, fb1 …: the core numbers them from 1.
      config_.id = 1 + static_cast<std::uint32_t>(std::stoul(GetId().substr(GetId().find_first_of("0123456789"))));
      views_ = std::make_unique<Views>(views);
      Reset();
    } catch (const std::exception& error) {
      throw argos::CARGoSException(std::string("gestalt: ") + error.what());
    }
  }

  void Reset() override {
    now_ = 0;
    human_ = std::make_unique<Human>(config_.seed, views_->hands(), views_->gestures());
    eye_ = std::make_unique<DrawnEye>(*views_, *human_, config_.seed, config_.id);
    robot_ = std::make_unique<Robot>(config_);
  }

  void ControlStep() override {
    for (const auto& heard : ears_->GetReadings()) {
      const std::size_t length = heard.Data.Size() == 0 ? 0 : heard.Data[0];
      if (length > 0 && length < heard.Data.Size()) robot_->hear(now_, heard.Data.ToCArray() + 1, length);
    }
    const argos::CVector3& at = place_->GetReading().Position;
    argos::CRadians angle, y, x;
    place_->GetReading().Orientation.ToEulerAngles(angle, y, x);
    move(at.GetX(), at.GetY(), angle.GetValue());
    eye_->stands_at(place_of(at.GetX(), at.GetY()));
    robot_->step(now_, *eye_);
    speak();
    now_ += step_;
    if (Human::into(now_) == 0) report();
  }

 private:
  /// Each robot has a sector of its own before the human: here nobody hands out places that are free.
  void move(double x, double y, double angle) {
    Wheels wheels;
    if (Human::into(now_) < Human::MOVING) {
      Chance chance(config_.seed ^ Human::showing_at(now_), config_.id);
      constexpr double SECTORS = 10, DEGREE = 3.14159265358979323846 / 180;
      const double sector = (config_.id - 1) % 10;
      const double bearing = (-75 + (sector + chance.between(0.3, 0.7)) * 150 / SECTORS) * DEGREE;
      const double away = chance.between(0.8, 1.2);
      wheels = drive(x, y, angle, away * std::sin(bearing), away * std::cos(bearing));
    }
    wheels_->SetLinearVelocity(wheels.left * CM, wheels.right * CM);
  }

  void speak() {
    speaker_->ClearData();
    const Bytes packet = robot_->send(now_);
    if (packet.empty()) return;
    speaker_->SetData(0, static_cast<argos::UInt8>(packet.size()));
    for (std::size_t i = 0; i < packet.size(); ++i) speaker_->SetData(i + 1, packet[i]);
  }

  void report() {
    const std::uint64_t showing = Human::showing_at(now_ - step_);
    const auto held = robot_->held();
    argos::LOG << "showing " << showing << ": shown " << human_->showing(showing).gesture << ", " << GetId() << " holds "
               << (held && held->gesture ? std::to_string(*held->gesture) : "nothing") << " of "
               << (held ? held->round : "no round") << std::endl;
  }

  argos::CCI_DifferentialSteeringActuator* wheels_ = nullptr;
  argos::CCI_RangeAndBearingActuator* speaker_ = nullptr;
  argos::CCI_RangeAndBearingSensor* ears_ = nullptr;
  argos::CCI_PositioningSensor* place_ = nullptr;
  RobotConfig config_;
  std::unique_ptr<Views> views_;
  std::unique_ptr<Human> human_;
  std::unique_ptr<DrawnEye> eye_;
  std::unique_ptr<Robot> robot_;
  std::uint64_t now_ = 0, step_ = 20'000'000;
};

}  // namespace

REGISTER_CONTROLLER(GestaltFootbot, "gestalt_footbot")
