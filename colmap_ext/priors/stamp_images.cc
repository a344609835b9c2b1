// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/priors/stamp_images.h"

#include <algorithm>
#include <map>
#include <tuple>
#include <utility>

#include "sensors/io/read_image_times.h"

namespace adasfm {
namespace {

StatusOr<std::vector<ImageStamp>> StampsFromFile(
    const std::string& path, const SceneData& scene,
    std::vector<std::string>* warnings) {
  const StatusOr<std::vector<ImageTime>> times = ReadImageTimes(path);
  if (!times.ok()) return times.status();
  const ImageFinder finder = BuildImageFinder(scene);
  std::map<image_t, ImageStamp> stamps;
  std::vector<std::string> unknown;
  for (const ImageTime& time : *times) {
    const std::vector<image_t> image_ids = finder.FindAll(time.name);
    if (image_ids.empty()) unknown.push_back(time.name);
    for (const image_t image_id : image_ids) {
      const std::string& name = scene.images.at(image_id).name;
      const ImageStamp stamp{image_id, name, time.timestamp_ns};
      const auto [known, is_new] = stamps.emplace(image_id, stamp);
      // Lists of several cameras name the same file once for each.
      if (!is_new && known->second.timestamp_ns != time.timestamp_ns) {
        return Status::Error(path + ": image " + name + " has two times");
      }
    }
  }
  if (stamps.empty()) {
    return Status::Error(
        path + ": none of its " + std::to_string(times->size()) +
        " images is in the database (the first one is " + unknown.front() +
        ", the database's first one is " + scene.images.begin()->second.name +
        "); check --image_times_path");
  }
  if (!unknown.empty()) {
    warnings->push_back(path + ": " + std::to_string(unknown.size()) + " of " +
                        std::to_string(times->size()) +
                        " images are not in the database (the first one is " +
                        unknown.front() + ")");
  }
  std::vector<ImageStamp> result;
  for (auto& [image_id, stamp] : stamps) result.push_back(std::move(stamp));
  return result;
}

StatusOr<std::vector<ImageStamp>> StampsFromNames(const SceneData& scene) {
  std::vector<ImageStamp> stamps;
  for (const auto& [image_id, image] : scene.images) {
    ImageStamp stamp{image_id, image.name, 0};
    if (ParseImageNameTime(image.name, &stamp.timestamp_ns)) {
      stamps.push_back(std::move(stamp));
    }
  }
  if (!stamps.empty()) return stamps;
  return Status::Error("the image names of the database (the first one is " +
                       scene.images.begin()->second.name +
                       ") are not times in nanoseconds; give "
                       "--image_times_path");
}

}  // namespace

ImageFinder BuildImageFinder(const SceneData& scene) {
  ImageFinder finder;
  for (const auto& [image_id, image] : scene.images) {
    finder.Add(image_id, image.name);
  }
  return finder;
}

void SortByTime(std::vector<ImageStamp>* stamps) {
  std::sort(stamps->begin(), stamps->end(),
            [](const ImageStamp& a, const ImageStamp& b) {
              return std::tie(a.timestamp_ns, a.image_id) <
                     std::tie(b.timestamp_ns, b.image_id);
            });
}

StatusOr<std::vector<ImageStamp>> StampImages(const std::string& path,
                                              const SceneData& scene,
                                              PriorImport* import) {
  StatusOr<std::vector<ImageStamp>> stamps =
      path.empty() ? StampsFromNames(scene)
                   : StampsFromFile(path, scene, &import->warnings);
  if (!stamps.ok()) return stamps;
  import->num_images_without_time = scene.images.size() - stamps->size();
  if (import->num_images_without_time > 0) {
    import->warnings.push_back(std::to_string(import->num_images_without_time) +
                               " images of the database have no time, and so "
                               "no priors");
  }
  SortByTime(&*stamps);
  return stamps;
}

}  // namespace adasfm
