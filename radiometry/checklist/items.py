"""Items of the printed checklist, by section, in the words of the print."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Item:
    """One line of the checklist."""

    key: str  # Stable key under which ticks are stored
    section: str  # Heading of the section
    text: str  # Text of the print


_SECTIONS: dict[str, dict[str, str]] = {
    "General Information": {
        "general_project_number": "Project Number",
        "general_date": "Date",
        "general_time": "Time",
        "general_recorder": "Recorder",
    },
    "Drone Camera Calibration Equipment": {
        "equipment_drone": "DJI INSPIRE 2 Drone attached with Zenmuse X5S camera",
        "equipment_batteries": "A set of fully charged Intelligent Flight Batteries",
        "equipment_sd_card": "A 4GB SD card for storing captured scene images",
        "equipment_illuminance_meter": "An Extech-HD450 illuminance meter",
        "equipment_luminance_meter": "A Gossen Starlight2 luminance meter",
        "equipment_spare_battery": "An extra 9V battery for illuminance meter",
        "equipment_lamp": "A dimmable lamp",
        "equipment_mobile_device": "A mobile device with DJI GO 4 app installed",
    },
    "Identification of Scenes with Different Illumination Levels": {
        "scenes_room_and_area": (
            "Find a room without any natural lighting, define a rectangular area on a flat surface using tape"
        ),
        "scenes_lamp_placed": "Place a dimmable lamp in front of the defined area at a distance",
        "scenes_levels": (
            "Adjust the output levels of the dimmable lamp from the brightest to the darkest until "
            "completely turned off to obtain different scene illumination levels based on project needs"
        ),
        "scenes_luminance_readings": (
            "Use the luminance meter to measure the luminance values of the defined rectangular scene "
            "for each illumination level and record the measured values"
        ),
    },
    "Adjust Zenmuse X5S Camera Settings for Image Shooting": {
        "settings_app_connected": (
            "Connect the mobile device with DJI GO 4 app installed to the drone remote controller"
        ),
        "settings_shutter_button": (
            "Tap the shutter/record switch button in the DJI GO 4 app and select shutter, then tap the "
            "shutter/record button again to take a picture"
        ),
        "settings_single_shooting": "Use the default 'Single Shooting Mode' of the drone camera",
        "settings_exposure_manual": "Set the exposure mode to be Manual",
        "settings_photo_style": "Set photo style to be Standard",
        "settings_photo_color": "Set photo color to be Black and White",
        "settings_white_balance": "Set white balance to be automatic white balance (AWB)",
        "settings_format_dng": "The images should be taken in (.DNG) format",
        "settings_enhancements_off": (
            "Any other settings meant to enhance the images taken by the camera should be turned off"
        ),
        "settings_spot_metering": "Set the camera to be Spot Metering",
    },
    "Image shooting": {
        "shooting_power_on": (
            "Power on the DJI Inspire 2 drone and unlock the Travel Mode to switch the drone into "
            "Landing Mode by pressing the drone power button a minimum of five times"
        ),
        "shooting_camera_mounted": "Mount the Zenmuse X5S Camera to the drone gimbal",
        "shooting_drone_placed": (
            "Place the drone at a table in front of the defined rectangular scene area, tilt the gimbal"
            " by scrolling the left dial of the remote controller to adjust the camera's field of view "
            "so that the defined scene area is centered in the camera view"
        ),
        "shooting_iso_and_apertures": (
            "For each scene with different illumination levels, change the ISO values to 3200, 6400, "
            "12800, or 25,600 respectively depending on users' data collection needs. For each ISO "
            "sensitivity, select different levels of aperture ranging from F1.7 to F16"
        ),
        "shooting_every_combination": (
            "For each combination of ISO, aperture, and shutter speed, tap the shutter/record button to"
            " take a photo"
        ),
        "shooting_settings_recorded": (
            "For each captured image, record the camera's current settings including the shutter speed,"
            " aperture, and ISO values"
        ),
    },
    "Extract pixel information": {
        "extract_to_tiff": (
            "Convert all the captured images into the lossless TIFF format and put them along with the "
            "developed script in the same folder"
        ),
        "extract_imagej_open": (
            "Open the ImageJ software and Click 'Plugins -> Macros -> Edit' to open the script in a "
            "separate window, then click 'Plugins -> Macros -> Record' to open the Recorder window. "
            "Keep these two windows open during the entire image analysis process"
        ),
        "extract_first_image": (
            "Open the first image in ImageJ by clicking 'File -> Open' and select the image"
        ),
        "extract_polygon": (
            "In the toolbar, select the 'Polygon selection' function, and draw a polygon with the same "
            "shape of the defined scene area on the selected image"
        ),
        "extract_coordinates": (
            "Switch to the Recorder window, find the according coordinates of each drawn polygon's "
            "corner in the brackets of the 'makePolygon' function"
        ),
        "extract_script_filled": (
            "Copy all the coordinates and paste them into the developed script to replace the values of"
            " the 'makePolygon' function and change the number in the 'for loop' condition based on the"
            " number of actual images that users intend to analyze"
        ),
        "extract_script_run": (
            "Ensure the current window is the script edit window, run the script by clicking 'Macros ->"
            " Run Macro'"
        ),
        "extract_results_saved": (
            "Export the extracted pixel results from in a separate window named as Results into csv "
            "files and save the files to a local folder"
        ),
    },
    "Estimate Dark Current": {
        "dark_lamp_off": (
            "After the image shooting process, keep all the equipment at the same place, turn off the "
            "lamp completely"
        ),
        "dark_frames": (
            "For each ISO sensitivity selected in the image shooting process, take another set of "
            "images with different aperture settings"
        ),
        "dark_extracted": (
            "Conduct the pixel information extraction process on the captured images, and record the "
            "mean pixel intensity of each image"
        ),
        "dark_median": (
            "Obtain the dark current for each ISO value by calculating the median of the images' mean "
            "pixel intensity"
        ),
    },
    "Camera Calibration Process": {
        "calibration_dark_subtracted": (
            "For each analyzed image, subtract the estimated dark current from the measured mean pixel "
            "intensity to obtain the adjusted pixel intensity"
        ),
        "calibration_rhs": (
            "Use the adjusted pixel intensity to calculate RHS and transform the RHS values by natural "
            "log fitting"
        ),
        "calibration_plot": (
            "Plot the extracted mean pixel intensity against the natural log transformed RHS based on "
            "the collected data for each ISO sensitivity"
        ),
        "calibration_regression": (
            "Conduct linear regression on the processed data to identify the mathematical relationship "
            "between mean pixel intensity and scene luminance"
        ),
    },
}

ITEMS: tuple[Item, ...] = tuple(
    Item(key=key, section=section, text=text)
    for section, lines in _SECTIONS.items()
    for key, text in lines.items()
)
