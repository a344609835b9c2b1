// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bags/extract_bag.h"

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <utility>

#include "colmap_ext/bags/camera_from_info.h"
#include "colmap_ext/bags/decode_image.h"
#include "colmap_ext/bags/write_bag_logs.h"
#include "colmap_ext/io/output_files.h"

namespace adasfm {
namespace {

namespace fs = std::filesystem;

constexpr char kImageFolder[] = "images";
constexpr char kTimesFile[] = "image_times.csv";
constexpr char kCameraFile[] = "camera.txt";
constexpr char kSensorsFile[] = "sensors.yaml";
// The share of the time that the pass for the logs takes.
constexpr double kLogShare = 0.2;

class BagExtractor {
 public:
  BagExtractor(const std::string& bag_path, const BagExtractionOptions& options,
               const std::string& folder, const ProgressCallback& progress)
      : bag_path_(bag_path),
        options_(options),
        folder_(folder),
        progress_(progress) {}

  StatusOr<BagExtraction> Run() {
    Status status = PrepareOutputFolder(folder_ + "/" + kImageFolder);
    if (status.ok()) status = ReadLogs();
    if (status.ok()) status = WriteCalibration();
    if (status.ok()) status = WriteBagLogs(logs_, folder_);
    if (status.ok()) status = WriteCamera();
    if (status.ok()) status = WritePhotos();
    if (!status.ok()) return status;
    Summarize();
    return std::move(result_);
  }

 private:
  Status ReadLogs();
  Status WriteCalibration();
  Status WriteCamera();
  Status WritePhotos();
  Status WritePhoto(const BagMessage& message, timestamp_t time_ns);
  void Summarize();

  void AddMissing(const std::string& what) {
    missing_ += (missing_.empty() ? "" : "; ") + what;
  }
  bool HasWheels() const {
    return !logs_.wheel.empty() || !logs_.odometry.empty();
  }

  const std::string& bag_path_;
  const BagExtractionOptions& options_;
  const std::string& folder_;
  const ProgressCallback& progress_;
  std::unique_ptr<BagReader> bag_;
  BagTopics topics_;
  BagLogs logs_;
  std::string camera_model_;
  ImageDecoder decoder_;
  std::map<timestamp_t, std::string> photos_;  // names of those written
  std::string missing_;
  BagExtraction result_;
};

Status BagExtractor::ReadLogs() {
  progress_("reading the logs", 0.0);
  StatusOr<std::unique_ptr<BagReader>> bag = OpenBag(bag_path_);
  if (!bag.ok()) return bag.status();
  bag_ = std::move(bag).value();
  const StatusOr<BagTopics> topics = FindDriveTopics(
      bag_path_, bag_->Topics(), options_.topics, options_.wheel_type);
  if (!topics.ok()) return topics.status();
  topics_ = *topics;
  if (!options_.has_calibration && topics_.wheel.has_value() &&
      topics_.wheel->type == "sensor_msgs/JointState") {
    AddMissing("the wheels' radius and distance (" + topics_.wheel->name +
               " is left out; give them as wheel0 of type ticks with "
               "--sensors_path)");
    topics_.wheel.reset();
  }
  StatusOr<BagLogs> logs = ReadBagLogs(bag_path_, bag_.get(), topics_,
                                       options_.wheel_type, &result_.warnings);
  if (!logs.ok()) return logs.status();
  logs_ = std::move(logs).value();
  if (logs_.image_times_ns.empty()) {
    return Status::Error(bag_path_ + ": no photo in " + topics_.image->name);
  }
  return Status::Ok();
}

Status BagExtractor::WriteCalibration() {
  if (options_.has_calibration) return Status::Ok();
  if (logs_.imu.empty() && !HasWheels()) {
    AddMissing("IMU and wheels (the model has no metres)");
    return Status::Ok();
  }
  const StatusOr<std::string> text = FormatBagCalibration(bag_path_, logs_);
  if (!text.ok()) return text.status();
  if (!logs_.imu.empty()) {
    AddMissing("the IMU's noise (typical values are in " + folder_ + "/" +
               kSensorsFile + ")");
  }
  return WriteTextFile(folder_ + "/" + kSensorsFile, *text);
}

Status BagExtractor::WriteCamera() {
  StatusOr<CalibratedCamera> camera = Status::Error("no CameraInfo beside it");
  if (logs_.camera_info.has_value()) {
    const bool is_rectified =
        topics_.image->name.find("rect") != std::string::npos;
    camera = CameraFromInfo(*logs_.camera_info, is_rectified);
  }
  if (!camera.ok()) {
    AddMissing("the camera's intrinsics (" + topics_.image->name + ": " +
               camera.status().message() +
               "; they are guessed unless --camera_params gives them)");
    return Status::Ok();
  }
  camera_model_ = camera->model;
  return WriteTextFile(folder_ + "/" + kCameraFile,
                       camera->model + " " + camera->params + "\n");
}

Status BagExtractor::WritePhoto(const BagMessage& message,
                                timestamp_t time_ns) {
  const std::string base =
      folder_ + "/" + kImageFolder + "/" + PhotoStem(time_ns);
  // The first photo is always decoded: it determines a shift for all photos.
  for (const char* extension : {".png", ".jpg"}) {
    if (photos_.empty()) break;
    if (!fs::exists(base + extension)) continue;
    photos_[time_ns] = PhotoStem(time_ns) + extension;
    return Status::Ok();
  }
  ImageFile file;
  const std::string cause = decoder_.Decode(message, &file);
  if (!cause.empty()) {
    return Status::Error(bag_path_ + ", photo of " + std::to_string(time_ns) +
                         " ns in " + message.topic->name + ": " + cause);
  }
  photos_[time_ns] = PhotoStem(time_ns) + file.extension;
  return WriteTextFile(base + file.extension,
                       std::string(file.bytes.begin(), file.bytes.end()));
}

Status BagExtractor::WritePhotos() {
  const StatusOr<std::set<timestamp_t>> selected =
      SelectPhotos(logs_, options_.photos);
  if (!selected.ok()) return selected.status();
  std::vector<std::string> repeated;  // warnings of the first pass
  Status status = bag_->Read(
      {topics_.image->name},
      [&](const BagMessage& message) {
        RosHeader header;
        ParseRosHeader(message.topic->encoding, message.bytes, &header);
        const bool is_wanted = message.topic->type == topics_.image->type &&
                               selected->count(header.stamp_ns) > 0 &&
                               photos_.count(header.stamp_ns) == 0;
        if (!is_wanted) return Status::Ok();
        progress_(
            "photo " + std::to_string(photos_.size() + 1) + " of " +
                std::to_string(selected->size()),
            kLogShare + (1.0 - kLogShare) * photos_.size() / selected->size());
        return WritePhoto(message, header.stamp_ns);
      },
      &repeated);
  std::string times = "#timestamp [ns],filename\n";
  for (const auto& [time_ns, name] : photos_) {
    times += std::to_string(time_ns) + "," + name + "\n";
  }
  if (status.ok()) status = WriteTextFile(folder_ + "/" + kTimesFile, times);
  return status;
}

void BagExtractor::Summarize() {
  std::string& text = result_.summary;
  text = "bag: " + std::to_string(photos_.size()) + " of " +
         std::to_string(logs_.image_times_ns.size()) + " photos from " +
         topics_.image->name;
  if (!camera_model_.empty()) text += ", camera " + camera_model_;
  if (!logs_.imu.empty()) {
    text += ", IMU " + topics_.imu->name + " (" +
            std::to_string(logs_.imu.size()) + " samples)";
  }
  if (HasWheels()) {
    text += ", wheels " + topics_.wheel->name + " (" + topics_.wheel->type +
            ", " + std::to_string(logs_.wheel.size() + logs_.odometry.size()) +
            " samples)";
  }
  if (!logs_.gnss.empty()) {
    text += ", GNSS " + topics_.gnss->name + " (" +
            std::to_string(logs_.gnss.size()) + " positions)";
  }
  if (!missing_.empty()) {
    result_.warnings.push_back("the bag does not tell " + missing_);
  }
}

}  // namespace

StatusOr<BagExtraction> ExtractBag(const std::string& bag_path,
                                   const BagExtractionOptions& options,
                                   const std::string& folder,
                                   const ProgressCallback& progress) {
  return BagExtractor(bag_path, options, folder, progress).Run();
}

std::string PhotoStem(timestamp_t time_ns) {
  char stem[24];
  std::snprintf(stem, sizeof(stem), "%019lld", static_cast<long long>(time_ns));
  return stem;
}

BagFiles FindBagFiles(const std::string& folder) {
  BagFiles files;
  const auto find = [&folder](const char* name) {
    const std::string path = folder + "/" + name;
    return fs::exists(path) ? path : std::string();
  };
  files.image_path = find(kImageFolder);
  files.image_times_path = find(kTimesFile);
  files.imu_path = find("imu.csv");
  files.wheel_path = find("wheel.csv");
  files.gnss_path = find("gnss.csv");
  files.sensors_path = find(kSensorsFile);
  std::ifstream(folder + "/" + kCameraFile) >> files.camera.model >>
      files.camera.params;
  return files;
}

Status RemoveBagFiles(const std::string& folder) {
  for (const char* name : {kImageFolder, "new", kTimesFile, kCameraFile,
                           kSensorsFile, "imu.csv", "wheel.csv", "gnss.csv"}) {
    std::error_code error;
    fs::remove_all(folder + "/" + name, error);
    if (error) {
      return Status::Error("cannot remove " + folder + "/" + name + ": " +
                           error.message());
    }
  }
  return Status::Ok();
}

}  // namespace adasfm
