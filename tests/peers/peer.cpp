#include "peer.h"

#include <time.h>

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <iostream>
#include <map>
#include <stdexcept>

namespace peer {

namespace {

using Json = nlohmann::json;

/// Steps that warm caches and branch predictors before the timed ones.
constexpr long kWarmUpSteps = 500;

double number_at(const Json& json, std::size_t i) { return json.at(i).get<double>(); }
Vec3 vector_of(const Json& json) { return {number_at(json, 0), number_at(json, 1), number_at(json, 2)}; }

Body read_body(const Json& json) {
  Body body;
  body.name = json.at("name");
  body.mass = json.at("mass");
  for (int i = 0; i < 9; ++i)
    body.inertia(i / 3, i % 3) = number_at(json.at("inertia"), static_cast<std::size_t>(i));
  body.position = vector_of(json.at("position"));
  const Json& q = json.at("orientation");
  body.orientation = Eigen::Quaterniond(number_at(q, 0), number_at(q, 1), number_at(q, 2), number_at(q, 3));
  body.velocity = vector_of(json.at("velocity"));
  body.angular_velocity = vector_of(json.at("angular_velocity"));
  return body;
}

JointKind kind_of(const std::string& word) {
  static const std::map<std::string, JointKind> kinds = {{"hinge", JointKind::hinge},
                                                         {"universal", JointKind::universal},
                                                         {"ball", JointKind::ball},
                                                         {"slider", JointKind::slider}};
  const auto found = kinds.find(word);
  if (found == kinds.end()) throw std::runtime_error("joint of unknown kind " + word);
  return found->second;
}

Joint read_joint(const Json& json, const std::map<std::string, int>& bodies) {
  Joint joint;
  joint.name = json.at("name");
  joint.kind = kind_of(json.at("kind"));
  joint.parent = bodies.at(json.at("parent"));
  joint.child = bodies.at(json.at("child"));
  joint.closes_loop = json.at("closes_loop");
  joint.anchor = vector_of(json.at("anchor"));
  for (const Json& axis : json.at("axes")) joint.axes.push_back(vector_of(axis));
  joint.forces = json.at("forces").get<std::vector<double>>();
  if (joint.closes_loop != (joint.kind == JointKind::ball))
    throw std::runtime_error("joint " + joint.name + ": loops are closed by ball joints, and by these alone");
  if (joint.closes_loop && joint.parent == kGround)
    throw std::runtime_error("joint " + joint.name + ": a loop is closed between two bodies");
  return joint;
}

Request read_request(std::istream& in) {
  const Json json = Json::parse(in);
  Request request;
  request.cost = json.at("task") == "cost";
  request.method = json.at("method");
  request.settings = json.at("settings");
  request.step = json.at("step");
  request.steps = json.at("steps");
  request.gravity = vector_of(json.at("gravity"));
  std::map<std::string, int> names = {{"world", kGround}};
  for (const Json& body : json.at("bodies")) {
    request.bodies.push_back(read_body(body));
    names[request.bodies.back().name] = static_cast<int>(request.bodies.size()) - 1;
  }
  for (const Json& joint : json.at("joints")) request.joints.push_back(read_joint(joint, names));
  return request;
}

/// All threads of the process count.
double cpu_now() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

void append(std::string& line, double value) {
  char text[32];
  const auto end = std::to_chars(text, text + sizeof text, value).ptr;
  line.append(text, end);
  line += ' ';
}

void append(std::string& line, const Vec3& v) {
  for (int i = 0; i < 3; ++i) append(line, v[i]);
}

void write_state(Mechanism& mechanism) {
  std::string line;
  append(line, mechanism.time());
  for (const BodyState& body : mechanism.state()) {
    append(line, body.position);
    append(line, body.orientation.w());
    append(line, body.orientation.vec());
    append(line, body.velocity);
    append(line, body.angular_velocity);
  }
  line.back() = '\n';
  std::fwrite(line.data(), 1, line.size(), stdout);
}

void write_motion(const Request& request, const Peer& peer) {
  const std::unique_ptr<Mechanism> mechanism = peer.make(request);
  const Json head = {
      {"engine", peer.engine}, {"version", peer.version}, {"kinetic_energy", mechanism->kinetic_energy()}};
  std::printf("%s\n", head.dump().c_str());
  write_state(*mechanism);
  for (long i = 0; i < request.steps; ++i) {
    mechanism->step();
    write_state(*mechanism);
  }
}

void write_cost(const Request& request, const Peer& peer) {
  {
    const std::unique_ptr<Mechanism> warm_up = peer.make(request);
    warm_up->run(std::min(request.steps, kWarmUpSteps));
  }
  const std::unique_ptr<Mechanism> mechanism = peer.make(request);
  const double energy = mechanism->kinetic_energy();
  const double start = cpu_now();
  mechanism->run(request.steps);
  const double seconds = cpu_now() - start;
  const Json head = {{"engine", peer.engine},
                     {"version", peer.version},
                     {"kinetic_energy", energy},
                     {"cpu_seconds", seconds}};
  std::printf("%s\n", head.dump().c_str());
}

}  // namespace

Eigen::Isometry3d Body::pose() const {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = orientation.toRotationMatrix();
  pose.translation() = position;
  return pose;
}

Eigen::Isometry3d Request::parent_pose(const Joint& joint) const {
  return joint.parent == kGround ? Eigen::Isometry3d::Identity()
                                 : bodies[static_cast<std::size_t>(joint.parent)].pose();
}

std::vector<double> Request::rates(const Joint& joint) const {
  const Body ground;
  const Body& p = joint.parent == kGround ? ground : bodies[static_cast<std::size_t>(joint.parent)];
  const Body& c = child(joint);
  const Vec3 w = c.angular_velocity - p.angular_velocity;
  switch (joint.kind) {
    case JointKind::hinge:
      return {joint.axes[0].dot(w)};
    case JointKind::slider: {
      const Vec3 vc = c.velocity + c.angular_velocity.cross(joint.anchor - c.position);
      const Vec3 vp = p.velocity + p.angular_velocity.cross(joint.anchor - p.position);
      return {joint.axes[0].dot(vc - vp)};
    }
    case JointKind::universal: {
      Eigen::Matrix<double, 3, 2> axes;
      axes << joint.axes[0], joint.axes[1];
      const Eigen::Vector2d rates = axes.colPivHouseholderQr().solve(w);
      return {rates[0], rates[1]};
    }
    case JointKind::ball:
      break;
  }
  return {};
}

int serve(const Peer& peer) try {
  const Request request = read_request(std::cin);
  for (const auto& setting : request.settings.items())
    if (std::find(peer.settings.begin(), peer.settings.end(), setting.key()) == peer.settings.end())
      throw std::runtime_error(peer.engine + " has no setting " + setting.key());
  if (request.cost)
    write_cost(request, peer);
  else
    write_motion(request, peer);
  return std::fflush(stdout) == 0 ? 0 : 1;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}

}  // namespace peer
