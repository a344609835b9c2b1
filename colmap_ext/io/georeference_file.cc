// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/io/georeference_file.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "colmap_ext/io/output_files.h"

namespace adasfm {

Status WriteGeoreference(const GeodeticPosition& origin,
                         const std::string& folder) {
  const EnuFrame frame(origin);
  const Eigen::Vector3d ecef = EcefFromGeodetic(origin);
  const Eigen::Matrix3d& rotation = frame.EcefFromEnuRotation();
  nlohmann::ordered_json json = {{"version", 1},
                                 {"frame", "ENU"},
                                 {"ellipsoid", "WGS 84"},
                                 {"origin",
                                  {{"latitude_deg", origin.latitude_deg},
                                   {"longitude_deg", origin.longitude_deg},
                                   {"height_m", origin.height_m}}}};
  json["ecef_from_enu"] = nlohmann::ordered_json::array();
  for (int row = 0; row < 3; ++row) {
    json["ecef_from_enu"].push_back(
        {rotation(row, 0), rotation(row, 1), rotation(row, 2), ecef(row)});
  }
  json["utm"] = UtmEpsgCode(FindUtmZone(origin));
  return WriteTextFile(folder + "/" + kGeoreferenceName, json.dump(2) + "\n");
}

StatusOr<GeodeticPosition> ReadGeoreference(const std::string& path) {
  std::ifstream file(path);
  if (!file) {
    return Status::Error(path +
                         ": no such file; a model made without positions is "
                         "nowhere on the Earth");
  }
  const nlohmann::json json =
      nlohmann::json::parse(file, nullptr, /*allow_exceptions=*/false);
  GeodeticPosition origin;
  try {
    const nlohmann::json& values = json.at("origin");
    values.at("latitude_deg").get_to(origin.latitude_deg);
    values.at("longitude_deg").get_to(origin.longitude_deg);
    values.at("height_m").get_to(origin.height_m);
    if (json.at("frame") == "ENU" && std::abs(origin.latitude_deg) <= 90.0 &&
        std::abs(origin.longitude_deg) <= 180.0) {
      return origin;
    }
  } catch (const nlohmann::json::exception&) {
  }
  return Status::Error(path + ": is not the georeference of a model");
}

Status UpdateGeoreference(bool is_georeferenced,
                          const std::optional<GeodeticPosition>& origin,
                          const std::string& folder) {
  if (is_georeferenced && origin) return WriteGeoreference(*origin, folder);
  std::error_code none;
  std::filesystem::remove(folder + "/" + kGeoreferenceName, none);
  return Status::Ok();
}

}  // namespace adasfm
