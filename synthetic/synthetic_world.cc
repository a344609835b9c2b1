// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/synthetic_world.h"

#include <stdexcept>

#include "core/so3.h"
#include "synthetic/drive.h"
#include "synthetic/image_pairs.h"
#include "synthetic/landmarks.h"
#include "synthetic/photo_settings.h"
#include "synthetic/sensor_logs.h"
#include "synthetic/street_grid.h"
#include "synthetic/traffic.h"

namespace adasfm {
namespace {

// The logs continue for this long after the last image, s.
constexpr double kTail = 0.5;
// Images are late or early by up to this share of their interval.
constexpr double kTimeJitter = 0.01;

SyntheticCamera MakeCamera(const SyntheticWorldOptions& options) {
  SyntheticCamera camera;
  camera.model = options.camera_model;
  camera.width = options.image_width;
  camera.height = options.image_height;
  camera.principal_x_px = 0.5 * camera.width;
  camera.principal_y_px = 0.5 * camera.height;
  const bool is_pinhole = camera.model == SyntheticCameraModel::kPinhole;
  camera.focal_px = (is_pinhole ? 0.6 : 0.42) * camera.width;
  if (!is_pinhole) camera.fisheye_coeffs << -0.02, 0.004, -0.001, 0.0001;
  return camera;
}

// Forward-looking (camera z along the body's x), rotated by a few degrees as
// real cameras are, ahead of and above the IMU.
Rigid3d MakeCamFromImu() {
  Eigen::Matrix3d axes;
  axes << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  const Eigen::Quaterniond turn =
      ExpSo3(Eigen::Vector3d(DegToRad(1.0), DegToRad(-2.0), DegToRad(0.5)));
  return CamFromWorldWithCenter(turn * Eigen::Quaterniond(axes),
                                Eigen::Vector3d(0.5, 0.05, 0.9));
}

// The second camera looks nearly the same way.
Rigid3d MakeCam1FromCam0(double baseline_m) {
  if (baseline_m == 0.0) return Rigid3d();
  const Eigen::Quaterniond turn =
      ExpSo3(Eigen::Vector3d(DegToRad(0.3), DegToRad(-0.5), DegToRad(0.2)));
  return CamFromWorldWithCenter(turn, Eigen::Vector3d(baseline_m, 0.0, 0.0));
}

// The largest number of keypoints of each image.
std::vector<int> DrawBlackouts(const SyntheticWorldOptions& options) {
  Random random = MakeRandom(options.seed, 12);
  std::vector<int> max_num_keypoints(options.num_images,
                                     options.num_keypoints_per_image);
  // One blackout in each of equally long stretches, away from their ends.
  for (int i = 0; i < options.num_blackouts; ++i) {
    const int64_t begin = int64_t{options.num_images} * i;
    const int first = static_cast<int>(begin / options.num_blackouts);
    const int last =
        static_cast<int>((begin + options.num_images) / options.num_blackouts);
    const int slack = last - first - options.blackout_num_images;
    const int start = first + static_cast<int>(random.UniformInt(
                                  slack / 4, slack - slack / 4));
    for (int k = 0; k < options.blackout_num_images; ++k) {
      max_num_keypoints[start + k] = options.blackout_num_keypoints;
    }
  }
  return max_num_keypoints;
}

// Images at the drive's times, up to a jitter. Returns the times.
std::vector<double> TakeImages(const Drive& drive, SyntheticWorld* world) {
  const SyntheticWorldOptions& options = world->options;
  Random random = MakeRandom(options.seed, 13);
  const timestamp_t shift_ns = NsFromSeconds(options.timeshift_cam_imu_s);
  std::vector<double> times_s;
  for (int i = 0; i < options.num_images; ++i) {
    const double jitter = random.Uniform(-kTimeJitter, kTimeJitter);
    const timestamp_t time_ns =
        NsFromSeconds(drive.ImageTimes()[i] + jitter * drive.ImagePeriod());
    const double time_s = SecondsFromNs(time_ns);
    SyntheticImage image;
    image.image_id = static_cast<image_t>(i + 1);
    image.timestamp_ns = kWorldStartNs + time_ns - shift_ns;
    image.name = std::to_string(image.timestamp_ns) + ".png";
    image.cam_from_world =
        world->cam_from_imu * drive.StateAt(time_s).world_from_imu.Inverse();
    world->images.push_back(image);
    times_s.push_back(time_s);
  }
  for (const Drive::Stop& stop : drive.stops()) {
    const auto at = [&](double time_s) {
      return kWorldStartNs - shift_ns + NsFromSeconds(time_s);
    };
    world->stops.emplace_back(at(stop.begin_s), at(stop.end_s));
  }
  return times_s;
}

// Fills keypoints and matches, with as many streets that look alike as the
// share of aliased pairs needs.
void FillImagesAndPairs(const std::vector<ExposurePoses>& rows,
                        const std::vector<double>& arc_lengths_m,
                        SyntheticWorld* world) {
  const SyntheticWorldOptions& options = world->options;
  for (int num_twins = FirstNumTwins(options);; num_twins *= 2) {
    const StreetGrid grid = BuildStreetGrid(options, num_twins);
    const LandmarkMap map = BuildLandmarks(options, grid);
    world->num_twins = num_twins;
    world->landmarks.clear();
    for (const Landmark& landmark : map.landmarks) {
      world->landmarks.push_back(landmark.position_in_world);
    }
    for (SyntheticImage& image : world->images) {
      image.keypoints.clear();
      image.landmark_ids.clear();
    }
    ObserveLandmarks(grid, map, DrawBlackouts(options), rows, world);
    AddTraffic(world);
    const double reached = MatchImages(grid, map, arc_lengths_m, world);
    if (reached == options.alias_pair_ratio) return;
    if (grid.can_have_more_twins) continue;
    throw std::invalid_argument(
        "SyntheticWorldOptions: alias_pair_ratio = " +
        std::to_string(options.alias_pair_ratio) +
        ", but the largest possible value of this drive is " +
        std::to_string(reached) +
        "; streets that look alike have to be driven in full, and far from "
        "each other");
  }
}

// Adds the images of the second camera, at the times of the first one.
void AddSecondCamera(SyntheticWorld* world) {
  const size_t num_frames = world->images.size();
  for (size_t i = 0; i < num_frames; ++i) {
    SyntheticImage image = world->images[i];
    world->images[i].name = "cam0/" + image.name;
    image.name = "cam1/" + image.name;
    image.image_id = static_cast<image_t>(num_frames + i + 1);
    image.camera_index = 1;
    image.cam_from_world = world->cam1_from_cam0 * image.cam_from_world;
    world->images.push_back(std::move(image));
  }
}

}  // namespace

Rigid3d ExposurePoses::CamFromWorldAt(double share) const {
  return CamFromWorldWithCenter(
      first_cam_from_world.rotation.slerp(share, last_cam_from_world.rotation),
      (1.0 - share) * first_cam_from_world.TargetOriginInSource() +
          share * last_cam_from_world.TargetOriginInSource());
}

SyntheticWorld BuildSyntheticWorld(const SyntheticWorldOptions& options) {
  std::string error;
  if (!options.IsValid(&error)) throw std::invalid_argument(error);
  SyntheticWorld world;
  world.options = options;
  world.camera = MakeCamera(options);
  world.cam_from_imu = MakeCamFromImu();
  world.cam1_from_cam0 = MakeCam1FromCam0(options.stereo_baseline_m);
  world.imu_from_wheel = Rigid3d(Eigen::Quaterniond::Identity(),
                                 Eigen::Vector3d(-0.4, 0.05, -0.3));
  // 1. The streets, the drive through them, and how the camera is set.
  const Drive drive(options, BuildPath(options, BuildStreetGrid(options).route),
                    world.imu_from_wheel);
  const std::vector<double> times_s = TakeImages(drive, &world);
  std::vector<double> arc_lengths_m;
  for (const double time_s : times_s) {
    arc_lengths_m.push_back(drive.ArcLengthAt(time_s));
  }
  if (options.stereo_baseline_m > 0.0) AddSecondCamera(&world);
  SetFocalFactors(&world);
  SetExposureGains(&world);
  OpenShutters(drive, times_s, &world);
  // 2. The logs.
  const double first_s = drive.FirstImageTime();
  const double end_s = times_s.back() + kTail;
  SimulateImu(drive, end_s, &world);
  SimulateWheels(drive, first_s, end_s, &world);
  SimulateGnss(drive, end_s, &world);
  // 3. What the camera sees, and the matches.
  FillImagesAndPairs(
      PosesWithin(drive, times_s, options.rolling_shutter_s, world),
      arc_lengths_m, &world);
  return world;
}

}  // namespace adasfm
