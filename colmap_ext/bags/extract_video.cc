// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bags/extract_video.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <utility>

#include "colmap_ext/io/output_files.h"
#include "colmap_ext/io/run_program.h"
#include "sensors/io/read_wheel.h"

namespace adasfm {
namespace {

namespace fs = std::filesystem;

// Width at which edges are measured: fast, and motion blur is wide enough.
constexpr char kFramesFilter[] =
    "scale='min(640,iw)':-2,blurdetect,settb=1/1000000000,"
    "metadata=mode=print:file=-";
// The share of the time that the pass over all frames takes.
constexpr double kFirstPassShare = 0.5;

class VideoExtractor {
 public:
  VideoExtractor(const std::string& video_path,
                 const VideoExtractionOptions& options,
                 const std::string& folder, const std::string& log_path,
                 const ProgressCallback& progress)
      : video_path_(video_path),
        options_(options),
        folder_(folder),
        log_path_(log_path),
        progress_(progress) {}

  StatusOr<BagExtraction> Run() {
    Status status = ReadDuration();
    if (status.ok()) status = ReadFrames();
    if (status.ok()) status = SelectFrames();
    if (status.ok()) status = WriteSelected();
    if (status.ok()) status = NamePhotos();
    if (!status.ok()) return status;
    BagExtraction result;
    result.summary = "video: " + std::to_string(selected_.size()) + " of " +
                     std::to_string(frames_.size()) + " frames";
    return result;
  }

 private:
  Status ReadDuration();
  Status ReadFrames();
  Status SelectFrames();
  Status WriteSelected();
  Status NamePhotos();
  // Name of a photo in the numbering of the second pass.
  std::string NewPhoto(int number) const {
    char name[24];
    std::snprintf(name, sizeof(name), "/new/%08d.jpg", number);
    return folder_ + name;
  }

  const std::string& video_path_;
  const VideoExtractionOptions& options_;
  const std::string& folder_;
  const std::string& log_path_;
  const ProgressCallback& progress_;
  double duration_s_ = 0.0;
  std::vector<VideoFrame> frames_;
  std::vector<int> selected_;
};

Status VideoExtractor::ReadDuration() {
  progress_("reading the video", 0.0);
  return RunProgram(
      {"ffprobe", "-v", "error", "-select_streams", "v:0", "-show_entries",
       "format=duration", "-of", "csv=p=0", video_path_},
      log_path_, [this](const std::string& line) {
        duration_s_ = std::atof(line.c_str());
      });
}

Status VideoExtractor::ReadFrames() {
  Status status = RunProgram(
      {"ffmpeg", "-nostdin", "-v", "error", "-i", video_path_, "-map", "0:v:0",
       "-vf", kFramesFilter, "-fps_mode", "passthrough", "-f", "null", "-"},
      log_path_, [this](const std::string& line) {
        int number = 0;
        long long time_ns = 0;
        if (std::sscanf(line.c_str(), "frame:%d pts:%lld", &number, &time_ns) ==
            2) {
          frames_.push_back({options_.start_ns + time_ns,
                             std::numeric_limits<double>::infinity()});
          const double share =
              time_ns * 1e-9 / std::max(duration_s_, time_ns * 1e-9 + 1e-3);
          progress_("looking at frame " + std::to_string(number + 1),
                    kFirstPassShare * share);
        } else if (!frames_.empty()) {
          // blurdetect gives no number for a frame without edges.
          double blur_px = 0.0;
          if (std::sscanf(line.c_str(), "lavfi.blur=%lf", &blur_px) == 1 &&
              blur_px > 0.0) {
            frames_.back().blur_px = blur_px;
          }
        }
      });
  if (status.ok() && frames_.empty()) {
    status = Status::Error(video_path_ + " has no frames");
  }
  const auto is_later = [](const VideoFrame& a, const VideoFrame& b) {
    return a.time_ns >= b.time_ns;
  };
  if (status.ok() && std::adjacent_find(frames_.begin(), frames_.end(),
                                        is_later) != frames_.end()) {
    status = Status::Error(video_path_ + ": the times of its frames do not " +
                           "ascend; convert it (ffmpeg -i VIDEO out.mp4)");
  }
  return status;
}

Status VideoExtractor::SelectFrames() {
  BagLogs logs;
  for (const VideoFrame& frame : frames_) {
    logs.image_times_ns.push_back(frame.time_ns);
  }
  if (options_.photos.image_distance_m > 0.0 && !options_.wheel_path.empty()) {
    const StatusOr<WheelType> type = ReadWheelType(options_.wheel_path);
    if (!type.ok()) return type.status();
    logs.wheel_type = *type;
    if (*type == WheelType::kOdometry) {
      StatusOr<std::vector<OdometryPose>> poses =
          ReadOdometry(options_.wheel_path);
      if (!poses.ok()) return poses.status();
      logs.odometry = std::move(poses).value();
    } else {
      StatusOr<std::vector<WheelSample>> samples =
          ReadWheel(options_.wheel_path, *type);
      if (!samples.ok()) return samples.status();
      logs.wheel = std::move(samples).value();
    }
  }
  const StatusOr<std::set<timestamp_t>> starts =
      SelectPhotos(logs, options_.photos);
  if (!starts.ok()) return starts.status();
  selected_ = SelectSharpFrames(
      frames_, std::vector<timestamp_t>(starts->begin(), starts->end()));
  return Status::Ok();
}

Status VideoExtractor::WriteSelected() {
  Status status = PrepareOutputFolder(folder_ + "/images");
  if (status.ok()) status = PrepareOutputFolder(folder_ + "/new");
  std::string filter = "select='0";
  for (const int index : selected_) {
    filter += "+eq(n," + std::to_string(index) + ")";
  }
  const std::string filter_path = folder_ + "/new/filter.txt";
  if (status.ok()) status = WriteTextFile(filter_path, filter + "'\n");
  if (!status.ok()) return status;
  return RunProgram(
      {"ffmpeg", "-nostdin", "-v", "error", "-y", "-progress", "pipe:1", "-i",
       video_path_, "-map", "0:v:0", "-filter_script:v", filter_path,
       "-fps_mode", "passthrough", "-q:v", "2", folder_ + "/new/%08d.jpg"},
      log_path_, [this](const std::string& line) {
        int number = 0;
        if (std::sscanf(line.c_str(), "frame=%d", &number) != 1) return;
        progress_("photo " + std::to_string(number) + " of " +
                      std::to_string(selected_.size()),
                  kFirstPassShare +
                      (1.0 - kFirstPassShare) * number / selected_.size());
      });
}

Status VideoExtractor::NamePhotos() {
  if (!fs::exists(NewPhoto(selected_.size())) ||
      fs::exists(NewPhoto(selected_.size() + 1))) {
    return Status::Error(video_path_ +
                         ": ffmpeg wrote other frames than asked for; see " +
                         log_path_);
  }
  std::string times = "#timestamp [ns],filename\n";
  for (size_t i = 0; i < selected_.size(); ++i) {
    const timestamp_t time_ns = frames_[selected_[i]].time_ns;
    const std::string name = PhotoStem(time_ns) + ".jpg";
    std::error_code error;
    fs::rename(NewPhoto(i + 1), folder_ + "/images/" + name, error);
    if (error) {
      return Status::Error("cannot write " + folder_ + "/images/" + name +
                           ": " + error.message());
    }
    times += std::to_string(time_ns) + "," + name + "\n";
  }
  std::error_code ignored;
  fs::remove_all(folder_ + "/new", ignored);
  return WriteTextFile(folder_ + "/image_times.csv", times);
}

}  // namespace

std::vector<int> SelectSharpFrames(const std::vector<VideoFrame>& frames,
                                   const std::vector<timestamp_t>& starts) {
  const auto find = [&frames](timestamp_t time_ns) {
    return std::lower_bound(frames.begin(), frames.end(), time_ns,
                            [](const VideoFrame& frame, timestamp_t time) {
                              return frame.time_ns < time;
                            });
  };
  std::vector<int> selected;
  for (size_t i = 0; i < starts.size(); ++i) {
    const auto begin = find(starts[i]);
    const auto next =
        i + 1 < starts.size() ? find(starts[i + 1]) : frames.end();
    const auto end = begin + (next - begin + 1) / 2;
    const auto sharpest = std::min_element(
        begin, end, [](const VideoFrame& a, const VideoFrame& b) {
          return a.blur_px < b.blur_px;
        });
    if (sharpest != end) selected.push_back(sharpest - frames.begin());
  }
  return selected;
}

StatusOr<BagExtraction> ExtractVideo(const std::string& video_path,
                                     const VideoExtractionOptions& options,
                                     const std::string& folder,
                                     const std::string& log_path,
                                     const ProgressCallback& progress) {
  return VideoExtractor(video_path, options, folder, log_path, progress).Run();
}

}  // namespace adasfm
